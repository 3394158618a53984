//! Program as a source of force: a force model whose wrench a program in the same process commands.
//!
//! ```text
//!  program                                             loop
//!  Port::command(wrench) -> latest-value cell -> model `program` -> mapping -> envelope -> device
//!  pose, wrench applied  <- Tap, latest-value cell  <------------------------------------- record of the tick
//! ```
//!
//! In a scene it is a model like any other (`plugin = "program"`): mapped, blended, limited and recorded. A wrench is valid for a
//! limited time after the first tick that reads it; then it fades to zero, and [`ProgramCounts`] counts the lapse. Force fades in
//! when the program enables it. Neither side waits for the other.

use crate::scene::{ModelUse, Scene};
use flotor_core::mapping::Mapping;
use flotor_core::words::{Decoder, Encoder};
use flotor_core::{fade, lock, to_ns};
use flotor_hal::abi::{Entry, Extensions, Interface, model_entry_with};
use flotor_hal::{
    Demand, ForceModel, GripModel, GripState, Input, Memory, ModelInfo, Output, Parameter, Refusal, Settings,
    StepStatus, Wrench,
};
use flotor_sync::{Observer, Publisher, Words, latest};
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Plugin id of the model in scenes.
pub const ID: &str = "program";

/// Plugin entry of the model, for a registry. `create` fails unless a free [`Port`] has the number of the parameter `port`.
pub static ENTRY: Entry = model_entry_with::<ProgramModel, Offered>();

/// Extensions of the model.
struct Offered;

impl Extensions<ProgramModel> for Offered {
    const LIST: &'static [Interface<ProgramModel>] = &[flotor_hal::extension::grip::offer()];
}

/// Scene text with the model, added to devices without such a model.
const MODEL: &str = "[device]\nplugin = \"none\"\n[[model]]\nplugin = \"program\"\n";

/// Fade-in time unless a scene sets `ramp_ms`, ms.
const RAMP_MS: f64 = 200.0;

/// Command from the program.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Command {
    wrench: Wrench,
    /// Effort at the grip of the device, N or N·m.
    effort: f64,
    /// Number of commands so far; distinguishes a repeated wrench, whose validity starts again.
    commands: u64,
    /// Number of times that force was enabled and disabled; odd: enabled.
    gate: u64,
    /// Validity time of the wrench, ns; 0: `valid_ms` of the scene.
    valid_ns: u64,
}

impl Words<COMMAND_WORDS> for Command {
    #[inline]
    fn to_words(&self) -> [u64; COMMAND_WORDS] {
        let Self { wrench, effort, commands, gate, valid_ns } = self;
        Encoder::of_zeros().wrench(wrench).words([*commands, *gate, *valid_ns]).numbers([*effort]).finish()
    }

    #[inline]
    fn from_words(words: &[u64; COMMAND_WORDS]) -> Self {
        let mut words = Decoder::of(words);
        let (wrench, commands, gate, valid_ns) = (words.wrench(), words.word(), words.word(), words.word());
        let [effort] = words.numbers();
        Self { wrench, effort, commands, gate, valid_ns }
    }
}

/// Number of words of a command.
const COMMAND_WORDS: usize = 10;

const NO_COMMAND: Command = Command { wrench: Wrench::ZERO, effort: 0.0, commands: 0, gate: 0, valid_ns: 0 };

/// Counters of the commands of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProgramCounts {
    /// Number of commanded wrenches, refused wrenches included.
    pub commands: u64,
    /// Number of wrenches refused because a component was NaN or infinite.
    pub refused: u64,
    /// Number of wrenches that expired and faded because no newer wrench was commanded.
    pub lapses: u64,
    /// Number of ticks in which an expired wrench was fading or had faded.
    pub lapsed_ticks: u64,
}

#[derive(Debug, Default)]
struct Lapses {
    count: AtomicU64,
    ticks: AtomicU64,
}

/// Model side of a port, free until a model is created with its number.
struct ModelEnd {
    command: Observer<Command, COMMAND_WORDS>,
    lapses: Arc<Lapses>,
}

/// Model sides of the ports that no model uses yet, by number.
static FREE: Mutex<Vec<(u32, ModelEnd)>> = Mutex::new(Vec::new());
static NEXT: AtomicU32 = AtomicU32::new(1);

/// Error of a wrench with a NaN or infinite component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a wrench has a number that is not finite; the previous wrench stays until it expires")]
pub struct NotFinite;

/// Program side of the connection: accepts the wrench on the hand, in the model frame, from any thread.
#[derive(Debug)]
pub struct Port {
    number: u32,
    command: Mutex<(Command, Publisher<Command, COMMAND_WORDS>)>,
    refused: AtomicU64,
    lapses: Arc<Lapses>,
}

impl Port {
    /// Opens a port with disabled force, and connects the next model that is created with the [number](Self::number) of the port
    /// as `port`. Not real-time.
    #[must_use]
    pub fn open() -> Self {
        let (publisher, command) = latest(NO_COMMAND);
        let (number, lapses) = (NEXT.fetch_add(1, Ordering::Relaxed), Arc::<Lapses>::default());
        lock(&FREE).push((number, ModelEnd { command, lapses: Arc::clone(&lapses) }));
        Self { number, command: Mutex::new((NO_COMMAND, publisher)), refused: AtomicU64::new(0), lapses }
    }

    /// Returns the number of this port, for the parameter `port` of the model that connects to it.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Commands the wrench on the hand, N and N·m, model frame, from the next tick on until the wrench expires. Bounded, but may
    /// wait for another thread that uses the same port.
    ///
    /// # Errors
    /// [`NotFinite`]; the previous wrench stays until it expires.
    pub fn command(&self, wrench: &Wrench) -> Result<(), NotFinite> {
        self.command_with_grip(wrench, 0.0)
    }

    /// Commands a wrench as [`Self::command`] does, and the effort at the device's grip, N or N·m, in the scale of the model.
    ///
    /// # Errors
    /// [`NotFinite`]; the previous command stays until it expires.
    pub fn command_with_grip(&self, wrench: &Wrench, effort: f64) -> Result<(), NotFinite> {
        if !(wrench.is_finite() && effort.is_finite()) {
            self.refused.fetch_add(1, Ordering::Relaxed);
            return Err(NotFinite);
        }
        self.change(|command| {
            (command.wrench, command.effort) = (*wrench, effort);
            command.commands += 1;
        });
        Ok(())
    }

    /// Enables the force, which fades in from the next tick on. Bounded, as [`Self::command`].
    pub fn enable(&self) {
        self.change(|command| command.gate += 1 - command.gate % 2);
    }

    /// Disables the force from the next tick on, without a fade, and clears the commanded wrench. Bounded, as [`Self::command`].
    pub fn disable(&self) {
        self.change(|command| {
            command.gate += command.gate % 2;
            (command.wrench, command.effort) = (Wrench::ZERO, 0.0);
        });
    }

    /// Returns true if the program has enabled the force.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        lock(&self.command).0.gate % 2 == 1
    }

    /// Sets the validity time of a wrench, ns, in place of the model's `valid_ms`; 0 restores `valid_ms`.
    pub fn set_validity(&self, valid_ns: u64) {
        self.change(|command| command.valid_ns = valid_ns);
    }

    /// Returns the counters so far.
    #[must_use]
    pub fn counts(&self) -> ProgramCounts {
        let refused = self.refused.load(Ordering::Relaxed);
        ProgramCounts {
            commands: lock(&self.command).0.commands + refused,
            refused,
            lapses: self.lapses.count.load(Ordering::Relaxed),
            lapsed_ticks: self.lapses.ticks.load(Ordering::Relaxed),
        }
    }

    fn change(&self, change: impl FnOnce(&mut Command)) {
        let mut command = lock(&self.command);
        let (command, publisher) = &mut *command;
        change(command);
        publisher.publish(command);
    }
}

/// Port for a device of a scene.
#[derive(Debug)]
pub struct Connected {
    /// Port with which the program commands the device.
    pub port: Port,
    /// Number of the device, from 0 in the scene's order.
    pub device: u16,
    /// Mapping between device frame and model frame, in which the program commands.
    pub mapping: Mapping,
    /// Fade-in time of the force after the program has enabled it, ns.
    pub ramp_ns: u64,
}

/// Creates a port for each device of a scene, in the scene's order, and assigns the port to the first model `program` on the
/// device; adds such a model to a device without one. Not real-time.
#[must_use]
pub fn connect(scene: &mut Scene) -> Vec<Connected> {
    let connect = |device: u16| {
        let is_ours = |model: &&mut ModelUse| model.plugin.plugin == ID && model.device == device;
        if !scene.models.iter_mut().any(|model| is_ours(&model)) {
            // Cannot fail: the text is built in, and a test parses it.
            let added =
                Scene::parse(std::path::Path::new("built-in program"), MODEL).map(|scene| scene.models);
            let named = scene.devices.get(usize::from(device)).map_or("", |device| device.name.as_str());
            let name = if device == 0 { ID.to_owned() } else { format!("{ID}-{named}") };
            scene.models.extend(added.unwrap_or_default().into_iter().map(|model| ModelUse {
                device,
                name: name.clone(),
                ..model
            }));
        }
        let port = Port::open();
        let model = scene.models.iter_mut().find(is_ours);
        let (mapping, ramp_ns) = model.map_or((Mapping::new(&Default::default()), 0), |model| {
            *model = model.replaced_by(None, &[("port", &port.number().to_string())]);
            let place = model.places_m.first().copied().unwrap_or_default();
            (Mapping::new(&model.mapping).at(place), ramp_ns(model))
        });
        Connected { port, device, mapping, ramp_ns }
    };
    let devices: Vec<u16> = (0..).zip(&scene.devices).map(|(device, _)| device).collect();
    devices.into_iter().map(connect).collect()
}

/// Returns the fade-in time of a model `program`, ns, as set in the scene. A value that is not a number gives the default; the
/// preparation of the scene rejects it.
fn ramp_ns(model: &ModelUse) -> u64 {
    let set = model.plugin.parameters.iter().rev().find(|parameter| parameter.key == "ramp_ms");
    set.and_then(|parameter| parameter.value.parse().ok()).map_or(nanoseconds(RAMP_MS), nanoseconds)
}

/// Converts ms of a parameter to ns.
fn nanoseconds(time_ms: f64) -> u64 {
    to_ns(time_ms * 1.0e-3)
}

/// Force model with the wrench of a program. All times are tick times, so that a run on the virtual clock is repeatable.
struct ProgramModel {
    end: ModelEnd,
    valid_ns: u64,
    fade_ns: u64,
    ramp_ns: u64,
    command: Command,
    version: u64,
    /// Time of the first tick with the newest wrench, ns.
    commanded_ns: u64,
    /// Start, as tick time, and duration of the fade-in, ns.
    since_ns: u64,
    rise_ns: u64,
    has_lapsed: bool,
    /// Part of the command that the last step passed, 0 to 1.
    passed: f64,
}

/// Returns the description of a time parameter, ms, `least` to a minute.
const fn time(id: &'static str, least: f64, default: f64, doc: &'static str) -> Parameter {
    Parameter::real(id, "ms", least, 60_000.0, default, doc)
}

impl ForceModel for ProgramModel {
    const INFO: ModelInfo = ModelInfo::new(
        ID,
        "Program",
        "The wrench that a program in the same process commands, for a limited time",
    )
    .serving(Demand::WRENCH)
    .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = &[
        Parameter::real(
            "port",
            "",
            0.0,
            4.0e9,
            0.0,
            "Number of the program that commands the model, set by `flotor lend` and the drop-in libraries",
        ),
        time("valid_ms", 1.0, 50.0, "Time for which a wrench is valid without a newer one"),
        time("fade_ms", 0.0, 50.0, "Time in which an expired wrench fades to zero"),
        time("ramp_ms", 0.0, RAMP_MS, "Time in which the force fades in after the program has enabled it"),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let number = settings.number_or_default("port");
        let mut free = lock(&FREE);
        let place = free.iter().position(|(free, _)| f64::from(*free) == number);
        let Some((_, end)) = place.map(|place| free.swap_remove(place)) else {
            return Err(Refusal::parameter(
                "no program commands this model; start a program with `flotor lend SCENE -- PROGRAM`, and give the \
                 model one place only",
            ));
        };
        let ns = |id| nanoseconds(settings.number_or_default(id));
        Ok(Self {
            end,
            valid_ns: ns("valid_ms"),
            fade_ns: ns("fade_ms"),
            ramp_ns: ns("ramp_ms"),
            command: NO_COMMAND,
            version: 0,
            commanded_ns: 0,
            since_ns: 0,
            rise_ns: 0,
            has_lapsed: false,
            passed: 0.0,
        })
    }

    fn step(&mut self, input: &Input) -> Output {
        let now_ns = input.time_ns;
        // A command that is being written now is read in the next tick.
        if let Some((version, command)) = self.end.command.read()
            && version != self.version
        {
            self.version = version;
            self.follow(command, now_ns);
        }
        let Command { wrench, effort, gate, valid_ns, .. } = self.command;
        if gate.is_multiple_of(2) || wrench == Wrench::ZERO && effort == 0.0 {
            (self.has_lapsed, self.passed) = (false, 0.0);
            return Wrench::ZERO.into();
        }
        let valid_ns = if valid_ns == 0 { self.valid_ns } else { valid_ns };
        let over_ns = now_ns.saturating_sub(self.commanded_ns).saturating_sub(valid_ns);
        let risen = fade(now_ns.saturating_sub(self.since_ns), self.rise_ns);
        if over_ns == 0 {
            self.passed = risen;
            return (wrench * risen).into();
        }
        if !self.has_lapsed {
            self.has_lapsed = true;
            self.end.lapses.count.fetch_add(1, Ordering::Relaxed);
        }
        self.end.lapses.ticks.fetch_add(1, Ordering::Relaxed);
        let left = risen * (1.0 - fade(over_ns, self.fade_ns));
        self.passed = left;
        Output::new(wrench * left, f64::NAN, StepStatus::OutOfDomain)
    }

    fn parameter(&self, index: usize) -> f64 {
        let ms = |ns: u64| ns as f64 * 1.0e-6;
        let values = [f64::NAN, ms(self.valid_ns), ms(self.fade_ns), ms(self.ramp_ns)];
        values.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl GripModel for ProgramModel {
    fn grip(&mut self, _: &Input, _: &GripState) -> f64 {
        self.command.effort * self.passed
    }
}

impl ProgramModel {
    /// Updates the times after a new command.
    fn follow(&mut self, command: Command, now_ns: u64) {
        if command.gate != self.command.gate {
            (self.since_ns, self.rise_ns, self.has_lapsed) = (now_ns, self.ramp_ns, false);
            self.commanded_ns = now_ns;
        }
        if command.commands != self.command.commands {
            if self.has_lapsed {
                // Fade in over the time of the fade-out.
                (self.since_ns, self.rise_ns, self.has_lapsed) = (now_ns, self.fade_ns, false);
            }
            self.commanded_ns = now_ns;
        }
        self.command = command;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::abi::CallStatus;
    use flotor_hal::{DVec3, GripKind, Pose};
    use flotor_loader::{Model, Plugin, Setting};

    const PUSH: Wrench = Wrench { force_n: [1.0, -2.0, 3.0], torque_nm: [0.1, 0.0, 0.0] };

    /// A port and its model: valid for 50 ms, fading for 50 ms, rising for 200 ms.
    fn connected() -> (Port, Model) {
        let port = Port::open();
        let model = model(port.number()).expect("its port is free");
        (port, model)
    }

    fn model(port: u32) -> Result<Model, String> {
        let plugin = Plugin::in_process(&ENTRY).expect("it is a plugin");
        let setting =
            Setting::number(plugin.parameters(), "port", f64::from(port)).expect("it is a parameter");
        plugin.create_model(&[setting]).map_err(|error| error.to_string())
    }

    fn at(model: &mut Model, time_ms: u64) -> (Wrench, Option<StepStatus>) {
        let input = Input { time_ns: time_ms * 1_000_000, tick: time_ms, ..Input::at_rest(Pose::HOME) };
        let mut output = Output::default();
        assert_eq!(model.step(&input, &mut output), CallStatus::Ok);
        (output.wrench, output.status())
    }

    #[test]
    fn a_model_without_a_program_is_refused_and_so_is_a_second_one() {
        assert!(model(0).is_err_and(|said| said.contains("flotor lend")));
        let (port, _model) = connected();
        assert!(model(port.number()).is_err());
    }

    #[test]
    fn nothing_is_felt_before_the_program_enables_force_and_then_it_fades_in() {
        let (port, mut model) = connected();
        port.command(&PUSH).expect("it is finite");
        assert_eq!(at(&mut model, 0), (Wrench::ZERO, Some(StepStatus::Ok)));
        port.enable();
        let mut last = 0.0;
        for time_ms in 1..=201 {
            port.command(&PUSH).expect("it is finite");
            let (wrench, _) = at(&mut model, time_ms);
            let part = wrench.force_n[0];
            // Steepest slope of the fade: 1.5 in 200 ms.
            assert!(part >= last && part - last <= 1.5 / 200.0 + 1.0e-12, "{time_ms}: {part} after {last}");
            last = part;
        }
        assert_eq!(at(&mut model, 202), (PUSH, Some(StepStatus::Ok)));
        port.disable();
        assert_eq!(at(&mut model, 203).0, Wrench::ZERO);
        assert_eq!(port.counts().lapses, 0);
    }

    #[test]
    fn a_wrench_expires_fades_to_zero_is_counted_once_and_comes_back_without_a_step() {
        let (port, mut model) = connected();
        port.enable();
        for time_ms in 0..=300 {
            port.command(&PUSH).expect("it is finite");
            at(&mut model, time_ms);
        }
        assert_eq!(at(&mut model, 350), (PUSH, Some(StepStatus::Ok)), "50 ms after the last one");
        let (half, status) = at(&mut model, 375);
        assert!(
            (half.force() - PUSH.force() * 0.5).length() < 1.0e-12 && status == Some(StepStatus::OutOfDomain)
        );
        assert_eq!(at(&mut model, 400).0.force(), DVec3::ZERO);
        assert_eq!(port.counts(), ProgramCounts { commands: 301, refused: 0, lapses: 1, lapsed_ticks: 2 });
        port.command(&PUSH).expect("it is finite");
        assert_eq!(at(&mut model, 401).0.force(), DVec3::ZERO, "from zero");
        assert_eq!(at(&mut model, 451).0, PUSH, "and back in 50 ms");
    }

    #[test]
    fn an_effort_without_a_wrench_is_enabled_expires_and_fades_as_a_wrench() {
        let (port, mut model) = connected();
        let mut effort = |port: &Port, time_ms: u64, commanded: Option<f64>| {
            if let Some(effort) = commanded {
                port.command_with_grip(&Wrench::ZERO, effort).expect("it is finite");
            }
            at(&mut model, time_ms);
            let grip = GripState::new(GripKind::Linear, 0.01, 0.0);
            model.grip(&Input::at_rest(Pose::HOME), &grip)
        };
        assert_eq!(effort(&port, 0, Some(-2.0)), 0.0, "not enabled");
        port.enable();
        let rising: Vec<f64> = (1..=201).map(|time_ms| effort(&port, time_ms, Some(-2.0))).collect();
        assert!(rising.is_sorted_by(|before, after| before >= after), "{rising:?}");
        assert_eq!((rising.first(), rising.last()), (Some(&0.0), Some(&-2.0)));
        assert_eq!(effort(&port, 251, None), -2.0, "50 ms after the last one");
        assert!((effort(&port, 276, None) + 1.0).abs() < 1.0e-12, "half of the fade");
        assert_eq!(effort(&port, 301, None), 0.0);
        assert_eq!(port.command_with_grip(&Wrench::ZERO, f64::NAN), Err(NotFinite));
        port.disable();
        assert_eq!(effort(&port, 302, None), 0.0);
    }

    #[test]
    fn zero_needs_no_repetition_and_a_number_that_is_not_finite_changes_nothing() {
        let (port, mut model) = connected();
        port.enable();
        port.command(&Wrench::ZERO).expect("it is finite");
        at(&mut model, 0);
        assert_eq!(at(&mut model, 10_000), (Wrench::ZERO, Some(StepStatus::Ok)));
        port.command(&PUSH).expect("it is finite");
        at(&mut model, 10_001);
        let broken = Wrench { force_n: [f64::NAN, 0.0, 0.0], ..PUSH };
        assert_eq!(port.command(&broken), Err(NotFinite));
        assert_eq!(at(&mut model, 10_040).0, PUSH);
        port.set_validity(5_000_000);
        let (fading, _) = at(&mut model, 10_041);
        assert!(fading.force().length() < PUSH.force().length(), "a validity of its own: {fading:?}");
        assert_eq!(port.counts(), ProgramCounts { commands: 3, refused: 1, lapses: 1, lapsed_ticks: 1 });
    }

    #[test]
    fn each_device_of_a_scene_gets_a_port_and_a_named_one_is_kept() {
        let text = "[[device]]\nname = \"left\"\nplugin = \"simulated\"\n[[device]]\nname = \"right\"\nplugin = \"simulated\"\n\
                    [[model]]\nname = \"mine\"\nplugin = \"program\"\ndevice = \"right\"\n[model.parameters]\nvalid_ms = 20\n";
        let mut scene = Scene::parse(std::path::Path::new("two"), text).expect("it is a scene");
        let ports = connect(&mut scene);
        assert_eq!(ports.iter().map(|connected| connected.device).collect::<Vec<_>>(), [0, 1]);
        let told = |name: &str| {
            let model = scene.models.iter().find(|model| model.name == name).expect("it is there");
            let values = model.plugin.parameters.iter().map(|parameter| parameter.value.clone());
            (model.device, values.collect::<Vec<_>>())
        };
        assert_eq!(told("mine"), (1, vec!["20".to_owned(), ports[1].port.number().to_string()]));
        assert_eq!(told("program"), (0, vec![ports[0].port.number().to_string()]));
    }
}
