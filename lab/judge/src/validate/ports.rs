//! Check of an object that several devices share: one port repeats a step or a contact set, and ports do not disturb each other.

use super::outcome::Outcome;
use super::path::{step, walk};
use super::subject::Subject;
use crate::wording;
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, DVec3, Demand, Input, MAX_PORTS, Output, Pose};
use flotor_loader::Model;

/// Steps of each check.
const STEPS: u64 = 1000;
/// Contact sets of each check, and the time between two of them, ns.
const CONTACT_SETS: u64 = 100;
const SLOW_NS: u64 = 5_000_000;
/// Distance between the handles of two ports, m: near enough for one object between all of them.
const APART_M: f64 = 2.0e-3;

pub(super) fn ports(subject: &Subject) -> Result<(), Outcome> {
    let (mut model, mut other) = (subject.prepared_model()?, subject.prepared_model()?);
    if model.has_world_contacts() {
        contacts(&mut subject.prepared_model()?, &mut subject.prepared_model()?)?;
    }
    if !model.has_ports() {
        return if model.has_world_contacts() {
            Ok(())
        } else {
            Err(Outcome::nothing_to_judge(
                "the model does not offer `flotor.world/1`: each device has an instance of its own",
            ))
        };
    }
    for input in walk(STEPS) {
        let (alone, [at_port, ..]) = (step(&mut other, &input)?, step_ports(&mut model, &[input])?);
        if bits(&alone) != bits(&at_port) {
            return Err(Outcome::Violation(format!(
                "at tick {} one port returned {}, and a step {}; return the same bits for one port",
                input.tick,
                wording::output(&at_port),
                wording::output(&alone)
            )));
        }
    }
    for count in 2..=MAX_PORTS {
        let all = model.serves();
        let usual = run(&mut model, count, |_, input| input.demand = all)?;
        let less = run(&mut model, count, |port, input| {
            input.demand = if port + 1 == count { all } else { Demand::FORCE };
        })?;
        let last = |outputs: &[Output; MAX_PORTS]| outputs.get(count - 1).map(bits);
        if let Some(tick) = usual.iter().zip(&less).position(|(a, b)| last(a) != last(b)) {
            return Err(Outcome::Violation(format!(
                "at tick {tick} the last of {count} ports returned another output when the others demanded the force \
                 alone; compute each port by its own demand"
            )));
        }
        let _ = run(&mut model, count, |port, input| {
            if port == 0 && input.tick % 7 == 3 {
                input.pose = Pose::new(DVec3::NAN, input.pose.orientation());
            }
        })?;
    }
    Ok(())
}

/// Checks the contacts of an asynchronous object: those at one port are those of a contact set, and every port has a valid set, also
/// while the pose at another is not finite.
fn contacts(model: &mut Model, other: &mut Model) -> Result<(), Outcome> {
    for input in walk(CONTACT_SETS).map(|input| Input { dt_ns: SLOW_NS * u64::from(input.tick > 0), ..input })
    {
        let [at_port, ..] = *contact_sets(model, &[input])?;
        let mut alone = ContactSet::NONE;
        if other.has_contact_set()
            && other.contact_set(&input, &mut alone) == CallStatus::Ok
            && alone != at_port
        {
            return Err(Outcome::Violation(format!(
                "at tick {} one port has other contacts than contact-set; return the same bits for one port",
                input.tick
            )));
        }
    }
    for count in 2..=MAX_PORTS {
        if model.reset() != CallStatus::Ok {
            return Err(Outcome::Violation("reset failed before the contacts of several ports".to_owned()));
        }
        for input in walk(CONTACT_SETS) {
            let inputs: Vec<Input> = (0..count)
                .map(|port| {
                    let position_m = match (port, input.tick % 7) {
                        (0, 3) => DVec3::NAN,
                        _ => input.pose.position() + DVec3::X * (APART_M * port as f64),
                    };
                    let dt_ns = SLOW_NS * u64::from(input.tick > 0);
                    Input { pose: Pose::new(position_m, input.pose.orientation()), dt_ns, ..input }
                })
                .collect();
            let sets = contact_sets(model, &inputs)?;
            for (port, set) in sets.iter().take(count).enumerate() {
                let is_finite = set.bilateral().is_finite();
                // Any period: how long a set is valid does not make it right or wrong.
                let problem =
                    flotor_contact::ContactSet::published(set, 1.0).err().map(|error| error.to_string());
                let problem = problem.or((!is_finite).then(|| "its bilateral part is not finite".to_owned()));
                if let Some(problem) = problem {
                    return Err(Outcome::Violation(format!(
                        "at tick {} the contacts at port {port} of {count} (from 0): {problem}; return a valid set at every port, \
                         also while the pose at another is not finite",
                        input.tick
                    )));
                }
            }
        }
    }
    Ok(())
}

/// Computes the contacts at all ports.
fn contact_sets(model: &mut Model, inputs: &[Input]) -> Result<Box<[ContactSet; MAX_PORTS]>, String> {
    let mut sets = Box::new([ContactSet::NONE; MAX_PORTS]);
    match model.contact_sets(inputs, &mut sets[..inputs.len()]) {
        CallStatus::Ok => Ok(sets),
        status => Err(format!("the contacts of {} ports failed: {}", inputs.len(), model.reason(status))),
    }
}

/// Steps a reset model along a walk at each of several ports; `change` changes the input of a port.
fn run(
    model: &mut Model,
    count: usize,
    change: impl Fn(usize, &mut Input),
) -> Result<Vec<[Output; MAX_PORTS]>, String> {
    match model.reset() {
        CallStatus::Ok => {}
        other => return Err(format!("reset returned `{}`", other.name())),
    }
    let at = |input: Input| {
        let inputs: Vec<Input> = (0..count)
            .map(|port| {
                let beside_m = DVec3::X * (APART_M * port as f64);
                let pose = Pose::new(input.pose.position() + beside_m, input.pose.orientation());
                let mut input = Input { pose, ..input };
                change(port, &mut input);
                input
            })
            .collect();
        let outputs = step_ports(model, &inputs)?;
        let is_usable = |output: &Output| {
            output.wrench.is_finite() && !output.energy_j.is_infinite() && output.status().is_some()
        };
        match outputs.iter().take(count).position(|output| !is_usable(output)) {
            None => Ok(outputs),
            Some(port) => Err(format!(
                "at tick {} port {port} of {count} (from 0) returned {}; return finite numbers at every port, also while \
                 the pose at another is not finite",
                input.tick,
                wording::output(&outputs[port])
            )),
        }
    };
    walk(STEPS).map(at).collect()
}

/// Steps the model once for all ports.
fn step_ports(model: &mut Model, inputs: &[Input]) -> Result<[Output; MAX_PORTS], String> {
    let mut outputs = [Output::default(); MAX_PORTS];
    match model.step_ports(inputs, &mut outputs) {
        CallStatus::Ok => Ok(outputs),
        status => Err(format!("a step of {} ports failed: {}", inputs.len(), model.reason(status))),
    }
}

fn bits(output: &Output) -> ([u64; 7], Option<flotor_hal::StepStatus>) {
    let ([fx, fy, fz], [tx, ty, tz]) = (output.wrench.force_n, output.wrench.torque_nm);
    // Every NaN is equal.
    let energy_j = if output.energy_j.is_nan() { f64::NAN } else { output.energy_j };
    ([fx, fy, fz, tx, ty, tz, energy_j].map(f64::to_bits), output.status())
}
