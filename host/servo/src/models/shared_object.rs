//! One instance of a model that several devices share, with a port for each.

use super::body::{Body, Marks};
use super::contribution::{Contribution, Sample, Share, usable};
use super::instance::{Instance, Usable};
use super::placement::Placement;
use crate::engine::{Engine, Stepped};
use flotor_core::health::ModelHealth;
use flotor_core::mapping::Mapping;
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Input, MAX_PORTS, Memory, Output, Pose, SampledLoop, Tick};
use flotor_loader::InstanceState;

/// One instance with a placement for each of its ports.
pub(crate) struct SharedObject {
    instance: Instance,
    ports: Box<[Placement]>,
    /// Input and output of each port, allocated once.
    inputs: Box<[Input]>,
    outputs: Box<[Output]>,
    serves: Demand,
    memory: Memory,
}

impl SharedObject {
    /// Creates the object with the mappings of its ports; returns it with the outputs that it can compute. Not real-time.
    pub(super) fn new(mut model: Engine, ports: Vec<Mapping>, sampled: &SampledLoop) -> (Self, Demand) {
        let (serves, memory, count) = (model.serves(), model.memory(), ports.len());
        let object = Self {
            ports: ports.into_iter().map(|mapping| Placement::new(&mut model, mapping, sampled)).collect(),
            instance: Instance::new(model),
            inputs: vec![Input::at_rest(Pose::HOME); count].into(),
            outputs: vec![Output::default(); count].into(),
            serves,
            memory,
        };
        (object, serves)
    }
}

impl Body for SharedObject {
    /// Sample at each port; `None` beyond the last.
    type Samples<'s> = [Option<Sample<'s>>; MAX_PORTS];
    type Share = [Contribution; MAX_PORTS];
    type Marks = [Events; MAX_PORTS];

    /// Steps the object once, for all its ports. An unusable output, or none in time, removes the force of its port only.
    fn step(
        &mut self,
        tick: &Tick,
        samples: &Self::Samples<'_>,
        health: &mut ModelHealth,
        events: &mut Self::Marks,
    ) -> Self::Share {
        let Self { instance, ports, inputs, outputs, serves, memory } = self;
        let mut shares = Self::Share::NONE;
        if !instance.begin(tick.index, *memory, health) {
            events.mark(Events::MODEL_FAULT);
            return shares;
        }
        for ((input, port), sample) in inputs.iter_mut().zip(&**ports).zip(samples.iter().flatten()) {
            *input = port.mapping.input(tick, sample.state, sample.demand.computed().limited_to(*serves));
        }
        outputs.fill(Output::default());
        let mut stepped = [Stepped::Answered; MAX_PORTS];
        if instance.model.step_ports(inputs, outputs, &mut stepped) != Stepped::Answered {
            instance.fail(tick.index, health);
            events.mark(Events::MODEL_FAULT);
            return shares;
        }
        let mut is_rejected = false;
        let answers = ports.iter().zip(inputs.iter().zip(&**outputs)).zip(samples.iter().flatten());
        for ((((port, (input, output)), sample), stepped), (share, events)) in
            answers.zip(stepped).zip(shares.iter_mut().zip(events.iter_mut()))
        {
            if stepped != Stepped::Answered
                && !matches!(instance.count(stepped, tick.index, health), Usable::Output)
            {
                events.insert(Events::MODEL_OVERRUN);
                continue;
            }
            let at_grip = |grip| instance.model.grip(input, &port.mapping.grip_to_model(grip));
            let effort = sample.grip.map_or(0.0, at_grip);
            match usable(sample.demand, *output).filter(|_| effort.is_finite()) {
                Some(output) => port.add_to(share, (&output, effort), input, sample, events),
                None => {
                    is_rejected = true;
                    events.insert(Events::MODEL_FAULT);
                }
            }
        }
        if is_rejected {
            health.rejected.count(tick.index);
        }
        if instance.has_changed_floats(tick.index, health) {
            events.mark(Events::FLOAT_ENVIRONMENT);
        }
        shares
    }

    fn set_parameter(
        &mut self,
        tick: &Tick,
        parameter: usize,
        value: f64,
        health: &mut ModelHealth,
    ) -> CallStatus {
        let Self { instance, ports, .. } = self;
        let status = instance.set_parameter(tick, parameter, value, health);
        if status == CallStatus::Ok {
            ports.iter_mut().for_each(|port| port.move_end(&mut instance.model));
        }
        status
    }

    fn parameters(&mut self) -> Vec<f64> {
        self.instance.model.parameters()
    }

    fn states(&mut self, tick: u64) -> impl Iterator<Item = Option<InstanceState<'_>>> {
        std::iter::once(self.instance.state(tick, self.memory))
    }

    fn with_stiffness(&self, mut health: ModelHealth) -> ModelHealth {
        for (number, port) in self.ports.iter().enumerate() {
            port.note_stiffness(&self.instance.model.felt_stiffness(number), &mut health.contacts);
        }
        health
    }

    fn last_message(&mut self) -> String {
        self.instance.model.last_message()
    }
}
