//! Scenes by chance: devices, limits, models, couplings, changes; what goes wrong in them, and what may reach a hand.

use super::log::Allowed;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The plugins of `tests/c/campaign/`.
pub(super) struct Plugins {
    /// A device that a hand may hold, and one that only simulates one.
    pub(super) devices: [PathBuf; 2],
    pub(super) wild: PathBuf,
}

/// A scene, and what is to hold.
pub(super) struct Drawn {
    pub(super) text: String,
    /// The log of each device, and what it may be told.
    pub(super) logs: Vec<(PathBuf, Allowed)>,
    /// The host's ceiling is lifted.
    pub(super) is_strong: bool,
}

/// Random numbers: a linear congruential generator (Knuth's MMIX) is random enough to draw a scene.
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    /// Evenly between 0 and 1.
    pub(super) fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(super) fn is(&mut self, chance: f64) -> bool {
        self.share() < chance
    }

    /// Between two numbers above zero, evenly in their logarithm.
    pub(super) fn between(&mut self, least: f64, most: f64) -> f64 {
        least * (most / least).powf(self.share())
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of a small number
        let index = (self.share() * count as f64) as usize;
        index.min(count - 1)
    }

    pub(super) fn of<T: Copy>(&mut self, words: &[T]) -> T {
        words[self.below(words.len())]
    }
}

/// A limit of the scene: its text, norm and axes.
struct Limit {
    text: String,
    norm: f64,
    axes: [f64; 3],
}

impl Limit {
    /// `is_planar`: some device does not drive z.
    fn draw(dice: &mut Dice, key: &str, usual: f64, is_planar: bool) -> Self {
        let norm = dice.between(0.2 * usual, 5.0 * usual);
        let axes = [0; 3].map(|_| dice.between(0.2 * usual, 5.0 * usual));
        let axes = [axes[0], axes[1], if is_planar { 0.0 } else { axes[2] }];
        let kind = if is_planar { 2 + dice.below(2) } else { dice.below(4) };
        match kind {
            0 => Self { text: String::new(), norm: f64::INFINITY, axes: [f64::INFINITY; 3] },
            1 => Self { text: format!("{key} = {norm:?}\n"), norm, axes: [norm; 3] },
            2 => Self { text: format!("{key} = {axes:?}\n"), norm: f64::INFINITY, axes },
            _ => Self { text: format!("{key} = {{ norm = {norm:?}, axes = {axes:?} }}\n"), norm, axes },
        }
    }
}

/// What changes of a model during a run, beside its weight.
enum Changes {
    Weight,
    Parameter,
    Plugin,
}

/// Whether a model of the scene dies.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Deaths {
    None,
    Some,
}

/// Draws a scene of so many ticks; the logs go to a folder.
pub(super) fn draw(
    dice: &mut Dice,
    plugins: &Plugins,
    folder: &Path,
    ticks: usize,
    rates: &[f64],
    deaths: Deaths,
) -> Drawn {
    let rate_hz = dice.of(rates);
    let duration_s = ticks as f64 / rate_hz;
    let mut text = format!("rate_hz = {rate_hz:?}\nduration_s = {duration_s:?}\n");
    let count = dice.of(&[1, 1, 1, 2, 2, 3]);
    let is_planar = count == 1 && dice.is(0.2);
    let is_strong = dice.is(0.2);
    let force = Limit::draw(dice, "force_n", 8.0, is_planar);
    let torque = Limit::draw(dice, "torque_nm", 0.5, false);
    let slews = [(); 2].map(|()| dice.is(0.5).then(|| dice.between(50.0, 50_000.0)));
    let mut logs = Vec::new();
    for device in 0..count {
        let is_simulated = dice.is(0.3);
        let log = folder.join(format!("device-{device}.log"));
        let (most_n, most_nm, slew) =
            (dice.between(1.0, 200.0), dice.between(0.05, 5.0), dice.between(100.0, 100_000.0));
        let file = &plugins.devices[usize::from(is_simulated)];
        let range_mm = dice.between(4.0, 40.0);
        let axes = if is_planar { 3 } else { dice.of(&[63, 63, 7]) };
        let _ = write!(
            text,
            "[[device]]\nname = \"d{device}\"\nplugin = {file:?}\n[device.parameters]\nlog = {log:?}\nseed = {}\nlost = {:?}\n\
             impossible = {:?}\nuntaken = {:?}\nfault_at = {}\nforce = {most_n:?}\ntorque = {most_nm:?}\nslew = {slew:?}\n\
             range_mm = {range_mm:?}\namplitude_mm = {:?}\naxes = {axes}\n",
            dice.below(1 << 40),
            dice.of(&[0.0, 0.01, 0.2]),
            dice.of(&[0.0, 0.001, 0.02]),
            dice.of(&[0.0, 0.0, 0.1]),
            if dice.is(0.1) { 1 + dice.below(ticks) } else { 0 },
            range_mm * dice.of(&[0.2, 0.7, 1.2]),
        );
        let ceiling = if is_simulated || is_strong { [f64::INFINITY; 2] } else { [20.0, 1.0] };
        let drives = |axis: usize| axes >> axis & 1 == 1;
        let own_n = [1.0, 1.5, 2.0].map(|times| times * most_n);
        let own_nm = [2.0, 1.5, 1.0].map(|times| times * most_nm);
        let axes_of = |own: [f64; 3], limit: &Limit, first: usize| {
            std::array::from_fn(
                |axis| if drives(axis + first) { own[axis].min(limit.axes[axis]) } else { 0.0 },
            )
        };
        let allowed = Allowed {
            norm: [force.norm.min(ceiling[0]), torque.norm.min(ceiling[1])],
            axes: [axes_of(own_n, &force, 0), axes_of(own_nm, &torque, 3)],
            slew_per_s: [slew, slew * 0.1],
            rise_per_s: [
                slews[0].unwrap_or(f64::INFINITY).min(slew),
                slews[1].unwrap_or(f64::INFINITY).min(slew * 0.1),
            ],
        };
        logs.push((log, allowed));
    }
    let is_coupled = count > 1 && dice.is(0.5);
    write_models(dice, &mut text, plugins, count, (ticks, duration_s), deaths);
    if is_coupled {
        let (stiffness, damping, delay) =
            (dice.between(10.0, 1.0e4), dice.between(0.1, 100.0), 1 + dice.below(40));
        let _ = write!(
            text,
            "[[coupling]]\nstiffness_n_per_m = {stiffness:?}\ndamping_ns_per_m = {damping:?}\ndelay_ticks = {delay}\n\
             passivity = \"{}\"\nend = [{{ device = \"d0\" }}, {{ device = \"d1\" }}]\n",
            dice.of(&["control", "observe"])
        );
    }
    write_limits(dice, &mut text, &force, &torque, slews, rate_hz, is_coupled);
    Drawn { text, logs, is_strong }
}

fn write_limits(
    dice: &mut Dice,
    text: &mut String,
    force: &Limit,
    torque: &Limit,
    slews: [Option<f64>; 2],
    rate_hz: f64,
    is_coupled: bool,
) {
    let _ = write!(text, "[limits]\n{}{}", force.text, torque.text);
    for (key, slew) in ["force_slew_n_per_s", "torque_slew_nm_per_s"].iter().zip(slews) {
        let _ = slew.map(|slew| writeln!(text, "{key} = {slew:?}"));
    }
    let ramp_s = dice.between(0.001, 0.5);
    let watchdog_ms = dice.between(3500.0 / rate_hz, 1.0e4);
    let _ = writeln!(text, "ramp_s = {ramp_s:?}\nwatchdog_ms = {:?}", watchdog_ms.max(1.0));
    if dice.is(0.3) {
        let _ = writeln!(text, "velocity_m_per_s = {:?}", dice.between(0.01, 2.0));
    }
    if !is_coupled && dice.is(0.4) {
        let _ = writeln!(text, "passivity = \"control\"");
    }
    if dice.is(0.5) {
        let _ = writeln!(
            text,
            "[boundary]\nmargin_mm = {:?}\nstiffness_n_per_m = {:?}\ndamping_ns_per_m = {:?}",
            dice.between(0.1, 2.0),
            dice.between(10.0, 1.0e5),
            dice.between(0.1, 500.0)
        );
    }
}

/// Models of every kind, and what becomes of them during the run.
fn write_models(
    dice: &mut Dice,
    text: &mut String,
    plugins: &Plugins,
    devices: usize,
    (ticks, duration_s): (usize, f64),
    deaths: Deaths,
) {
    let wild = plugins.wild.display().to_string();
    let (count, mut names) = (1 + dice.below(3), Vec::new());
    let dying = (deaths == Deaths::Some).then(|| dice.below(count));
    for model in 0..count {
        let (name, device) = (format!("m{model}"), dice.below(devices));
        let kind = if dying == Some(model) { 0 } else { dice.below(8) };
        let plugin = match kind {
            5 => "spring",
            6 => "wall",
            7 => "membrane",
            _ => wild.as_str(),
        };
        let is_field = matches!(kind, 4 | 7);
        let isolation = if dying == Some(model) { dice.of(&["none", "none", "process"]) } else { "none" };
        let _ = write!(
            text,
            "[[model]]\nname = \"{name}\"\nplugin = \"{plugin}\"\ndevice = \"d{device}\"\nisolation = \"{isolation}\"\n\
             blend = {{ weight = {:?}, priority = {}, fade_s = {:?} }}\n",
            dice.of(&[1.0, 1.0, 0.5]),
            dice.below(3),
            dice.between(0.001, 0.3)
        );
        if !is_field && kind < 5 && dice.is(0.3) {
            let (motion, force) = (dice.between(0.1, 10.0), dice.between(0.1, 10.0));
            let _ = writeln!(
                text,
                "mapping = {{ rotation_xyzw = [0.5, 0.5, -0.5, 0.5], motion_scale = {motion:?}, force_scale = {force:?} }}"
            );
        }
        if is_field {
            let _ = writeln!(text, "[model.field]\nrate_hz = {:?}", dice.of(&[20.0, 50.0, 100.0]));
        }
        if kind < 5 {
            let (seed, scale) = (dice.below(1 << 40), dice.between(0.01, 1.0e4));
            let _ = writeln!(text, "[model.parameters]\nseed = {seed}\nscale = {scale:?}");
            if dying == Some(model) {
                let death = dice.of(&[
                    "segv",
                    "abort",
                    "fpe",
                    "exit",
                    "thread_exit",
                    "pthread_exit",
                    "stack",
                    "usr2",
                    "slow",
                    "panic",
                ]);
                let _ = writeln!(text, "death = \"{death}\"\nat = {}", 1 + dice.below(ticks));
            }
        }
        let changes = match kind {
            4 => Changes::Parameter,
            7 => Changes::Weight,
            0..4 if dice.is(0.5) => Changes::Parameter,
            _ => Changes::Plugin,
        };
        names.push((name, changes));
    }
    for _ in 0..dice.below(5) {
        let at_s = 0.9 * dice.share() * duration_s;
        let (name, kind) = &names[dice.below(names.len())];
        let what = match (kind, dice.is(0.7)) {
            (Changes::Parameter, true) => format!("set = \"{name}.scale={:?}\"", dice.between(0.01, 1.0e4)),
            (Changes::Plugin, true) => {
                let by = dice.of(&["spring", "wall", wild.as_str()]);
                format!("swap = \"{name}\"\nplugin = \"{by}\"")
            }
            _ => format!("weight = \"{name}={:?}\"", dice.of(&[0.0, 0.3, 1.0])),
        };
        let _ = writeln!(text, "[[change]]\nat_s = {at_s:?}\n{what}");
    }
}
