//! Implementation of the device contract for the puck: pose in, no force out.

use crate::motion::{Deflection, Gains, Motion, MotionRequest};
use crate::platform::PATH_HELP;
use crate::report::Report;
use crate::source::{Gone, HidPuck, REPORT_BYTES, Reports};
use flotor_hal::{
    Axes, Capabilities, Cycle, DeviceInfo, DeviceState, Fault, LoopConfig, NothingToStop, Opened, Parameter,
    Refusal, SetParameterError, Settings, Simple, SimpleDevice, Tick, Wrench, export_device,
};

/// Limit on reports read in a tick: a puck sends one or two every 8 ms or slower. Further reports stay pending until
/// the next tick.
const REPORTS_PER_TICK: usize = 8;
/// Longest time step of the motion, s: after a longer pause the pose does not catch up.
const LONGEST_TIME_S: f64 = 0.1;

const SPEED: usize = 0;
const SPIN: usize = 1;
const DEAD_ZONE: usize = 2;
const HOME_BUTTON: usize = 5;

const SCHEMA: &[Parameter] = &[
    Parameter::real("speed_mm_per_s", "mm/s", 0.1, 1000.0, 20.0, "Speed of the pose at full deflection")
        .live(),
    Parameter::real(
        "spin_deg_per_s",
        "°/s",
        0.0,
        360.0,
        20.0,
        "Angular speed of the pose at full deflection",
    )
    .live(),
    Parameter::real("dead_zone", "1", 0.0, 0.9, 0.08, "Dead zone, as a fraction of full deflection").live(),
    Parameter::real("range_mm", "mm", 0.1, 1000.0, 12.0, "Largest distance of the pose from home"),
    Parameter::real("range_deg", "°", 0.0, 170.0, 7.0, "Largest rotation of the pose from home"),
    Parameter::real(
        "home_button",
        "1",
        0.0,
        32.0,
        1.0,
        "Number, from 1, of the button that moves the pose home while pressed; 0: none",
    )
    .live(),
    Parameter::text("path", PATH_HELP),
];

/// Current parameter values.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Values([f64; SCHEMA.len()]);

impl Values {
    fn new(settings: &Settings<'_>) -> Self {
        Self(settings.values().try_into().unwrap_or([0.0; SCHEMA.len()]))
    }

    fn gains(&self) -> Gains {
        let [speed_mm_per_s, spin_deg_per_s, dead_zone, range_mm, range_deg, ..] = self.0;
        Gains {
            speed_m_per_s: speed_mm_per_s * 1.0e-3,
            spin_rad_per_s: spin_deg_per_s.to_radians(),
            dead_zone,
            range_m: range_mm * 1.0e-3,
            range_rad: range_deg.to_radians(),
        }
    }

    /// Returns the bit mask of the button that brings the pose home; 0 for none.
    fn home_bit(&self) -> u32 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked: 0 to 32
        let button = self.0[HOME_BUTTON] as u32;
        button.checked_sub(1).and_then(|bit| 1_u32.checked_shl(bit)).unwrap_or(0)
    }
}

/// Opened puck, with the pose that its reports move. The source of reports is a type parameter so that tests can supply a source
/// of their own.
pub struct SpaceMouse<S = HidPuck> {
    source: S,
    values: Values,
    deflection: Deflection,
    motion: Motion,
    buttons: u32,
}

impl<S: Reports> SpaceMouse<S> {
    /// Creates a puck with its pose at home.
    fn new(source: S, values: Values) -> Self {
        Self { source, values, deflection: Deflection::default(), motion: Motion::default(), buttons: 0 }
    }

    fn take_reports(&mut self) -> Result<(), Gone> {
        let mut bytes = [0; REPORT_BYTES];
        for _ in 0..REPORTS_PER_TICK {
            let length = self.source.next(&mut bytes)?;
            if length == 0 {
                break;
            }
            let report = Report::parse(bytes.get(..length).unwrap_or(&bytes));
            self.deflection.update(&report);
            if let Report::Buttons(buttons) = report {
                self.buttons = buttons;
            }
        }
        Ok(())
    }
}

impl<S: Reports> SimpleDevice for SpaceMouse<S> {
    const INFO: DeviceInfo =
        DeviceInfo::new("spacemouse", "3Dconnexion SpaceMouse", "A six-axis puck: pose in, no force out");
    const PARAMETERS: &'static [Parameter] = SCHEMA;
    type Stop = NothingToStop;

    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
        let device = Self::new(S::open(settings.text("path"))?, Values::new(settings));
        let Gains { range_m, range_rad, .. } = device.values.gains();
        // A report every 8 ms and slower.
        let capabilities =
            Capabilities::UNDRIVEN.sensing(Axes::ALL).with_range(range_m, range_rad).with_latency(8.0e-3);
        Ok(Opened { device, capabilities, stop: NothingToStop })
    }

    /// Resets the pose to home and the deflection to zero.
    fn activate(&mut self, _config: &LoopConfig) -> Result<(), Refusal> {
        (self.deflection, self.motion, self.buttons) = Default::default();
        Ok(())
    }

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        if self.take_reports() == Err(Gone) {
            return Cycle::Fault(Fault::Disconnected);
        }
        let request = match self.buttons & self.values.home_bit() {
            0 => MotionRequest::Follow(self.deflection),
            _ => MotionRequest::Home,
        };
        let dt_s = (tick.dt_ns as f64 * 1.0e-9).min(LONGEST_TIME_S);
        let twist = self.motion.advance(&request, &self.values.gains(), dt_s);
        *state = DeviceState {
            pose: self.motion.pose(),
            twist,
            sampled_ns: tick.time_ns,
            buttons: self.buttons,
            ..DeviceState::HOME
        };
        Cycle::Fresh
    }

    fn write(&mut self, _tick: &Tick, _wrench: &Wrench) -> Cycle {
        Cycle::Fresh
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        match self.values.0.get_mut(index) {
            Some(place) if [SPEED, SPIN, DEAD_ZONE, HOME_BUTTON].contains(&index) => *place = value,
            _ => return Err(SetParameterError::Fixed),
        }
        Ok(())
    }
}

export_device!(Simple<SpaceMouse>);

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::DVec3;
    use std::collections::VecDeque;

    /// Reports as a puck would send them; at the end it is unplugged.
    struct Scripted(VecDeque<Option<Vec<u8>>>);

    impl Reports for Scripted {
        fn open(_path: Option<&str>) -> Result<Self, Refusal> {
            Ok(Self(VecDeque::new()))
        }

        fn next(&mut self, report: &mut [u8; REPORT_BYTES]) -> Result<usize, Gone> {
            match self.0.pop_front() {
                None => Err(Gone),
                Some(None) => Ok(0),
                Some(Some(bytes)) => {
                    report[..bytes.len()].copy_from_slice(&bytes);
                    Ok(bytes.len())
                }
            }
        }
    }

    fn motion(number: u8, axes: [i16; 3]) -> Option<Vec<u8>> {
        Some([number].into_iter().chain(axes.iter().flat_map(|axis| axis.to_le_bytes())).collect())
    }

    fn read(puck: &mut SpaceMouse<Scripted>, index: u64) -> (Cycle, DeviceState) {
        let mut state = DeviceState::HOME;
        let dt_ns = if index == 0 { 0 } else { 1_000_000 };
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns };
        (puck.read(&tick, &mut state), state)
    }

    fn puck(reports: impl IntoIterator<Item = Option<Vec<u8>>>) -> SpaceMouse<Scripted> {
        let mut values = [0.0; SCHEMA.len()];
        values.iter_mut().zip(SCHEMA).for_each(|(value, parameter)| *value = parameter.default());
        SpaceMouse::new(Scripted(reports.into_iter().collect()), Values(values))
    }

    #[test]
    fn a_push_moves_the_pose_until_it_is_let_go_and_a_button_brings_it_home() {
        // Pushed away from the user for 100 ticks, then let go, then button 1.
        let pushed = [motion(1, [0, -350, 0]), None].into_iter().chain((0..99).map(|_| None));
        let let_go = [motion(1, [0; 3]), None].into_iter().chain((0..9).map(|_| None));
        let home = [Some(vec![3, 1, 0]), None].into_iter().chain((0..499).map(|_| None));
        let mut puck = puck(pushed.chain(let_go).chain(home));
        let states: Vec<DeviceState> = (0..610).map(|index| read(&mut puck, index).1).collect();
        // 20 mm/s for 99 steps of a millisecond.
        let there = states[99].pose.position();
        assert!((there - DVec3::Y * 1.98e-3).length() < 1.0e-12, "{there}");
        assert_eq!(states[109].pose.position(), there);
        assert_eq!((states[110].buttons, states[109].buttons), (1, 0));
        assert!(states[111].pose.position().y < there.y && states[111].twist.linear().y < 0.0);
        assert_eq!(states[609].pose.position(), DVec3::ZERO);
    }

    #[test]
    fn a_flood_of_reports_is_spread_over_ticks_and_unplugging_is_a_fault() {
        let flood = (0..20).map(|index| motion(2, [index, 0, 0]));
        let mut puck = puck(flood);
        let (cycle, _) = read(&mut puck, 0);
        assert_eq!((cycle, puck.source.0.len()), (Cycle::Fresh, 20 - REPORTS_PER_TICK));
        let faults: Vec<Cycle> = (1..4).map(|index| read(&mut puck, index).0).collect();
        assert_eq!(faults[2], Cycle::Fault(Fault::Disconnected));
        assert_eq!(faults[0], Cycle::Fresh);
    }

    #[test]
    fn live_parameters_change_and_the_range_does_not() {
        let mut puck = puck([motion(1, [350, 0, 0]), None, None, None, None]);
        let _ = read(&mut puck, 0);
        assert!(puck.set_parameter(SPEED, 40.0).is_ok() && puck.set_parameter(3, 5.0).is_err());
        let (_, state) = read(&mut puck, 1);
        assert!((state.twist.linear().x - 0.04).abs() < 1.0e-12);
    }
}
