//! Controller over a free body: results of procedures against closed forms, and settings read back.

use super::{Answer, Controller, ControllerConfig, Flight, ForceCommand, ProcedureId};
use crate::controller::Sample;
use flotor_hal::{DVec3, Pose, Twist, Wrench};
use flotor_maglev::ml_api::*;

const MASS_KG: f64 = 0.555;
const GRAVITY: f64 = 9.806_65;
/// A servo interval: a millisecond.
const DT_S: f64 = 1.0e-3;
/// Where the body comes to rest, m.
const FLOOR_M: f64 = -9.5e-3;

/// A point of mass above a floor that takes all of a fall, under the controller.
struct Rig {
    controller: Controller,
    position: DVec3,
    velocity: DVec3,
}

impl Rig {
    fn new(force_command: ForceCommand) -> Self {
        let controller = Controller::new(ControllerConfig { force_command, ..ControllerConfig::default() });
        Self { controller, position: DVec3::Z * FLOOR_M, velocity: DVec3::ZERO }
    }

    fn sample(&self) -> Sample {
        let pose = Pose { position_m: self.position.to_array(), ..Pose::HOME };
        Sample { pose, twist: Twist::new(self.velocity, DVec3::ZERO), ..Sample::HOME }
    }

    fn step(&mut self) -> Wrench {
        self.controller.sense(&self.sample(), DT_S);
        let wrench = self.controller.drive(DT_S);
        self.velocity += (wrench.force() / MASS_KG - DVec3::Z * GRAVITY) * DT_S;
        self.position += self.velocity * DT_S;
        if self.position.z < FLOOR_M {
            (self.position.z, self.velocity) = (FLOOR_M, DVec3::ZERO);
        }
        wrench
    }

    fn run(&mut self, milliseconds: u32) {
        for _ in 0..milliseconds {
            self.step();
        }
    }

    fn call(&mut self, request: Request) -> Reply {
        match self.controller.answer(&request) {
            Answer::Now(reply) => reply,
            Answer::When(procedure_id) => self.finish(procedure_id),
        }
    }

    fn finish(&mut self, procedure_id: ProcedureId) -> Reply {
        for _ in 0..60_000 {
            self.step();
            if let Some(reply) = self.controller.reply(procedure_id) {
                return reply;
            }
        }
        panic!("the procedure has no end");
    }

    fn plain(&mut self, function: Function) -> Reply {
        self.call(Request::Plain(function))
    }

    fn six(&mut self, function: Function) -> AxisValues {
        match self.plain(function).results {
            Results::AxisValues(values) => values,
            other => panic!("{other:?}"),
        }
    }

    fn status(&mut self, request: Request) -> Status {
        self.call(request).status
    }

    fn flying(force_command: ForceCommand) -> Self {
        let mut rig = Self::new(force_command);
        assert_eq!(rig.plain(Function::Takeoff).status, Status::OK);
        rig.run(1000);
        rig
    }
}

#[test]
fn taking_off_sags_by_what_the_gains_do_not_carry_and_gravity_takes_the_sag_away() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    // Weight less the feed-forward of 3.5 N, over 10 000 N/m.
    let sag = (MASS_KG * GRAVITY - 3.5) / 10_000.0;
    assert!((rig.position.z + sag).abs() < 1.0e-6, "{}", rig.position.z);
    let gravity = rig.six(Function::FindGravity);
    // Within what the procedure calls found.
    assert!((f64::from(gravity[2]) - MASS_KG * GRAVITY).abs() < 5.0e-3, "{gravity:?}");
    assert_eq!(rig.six(Function::GetGravity), [0.0; 6], "it is not stored by finding it");
    assert_eq!(rig.status(Request::AxisValues(Function::SetGravity, gravity)), Status::OK);
    assert_eq!(rig.plain(Function::DefyGravity).status, Status::OK);
    rig.run(2000);
    assert!(rig.position.z.abs() < 1.0e-6, "{}", rig.position.z);
}

#[test]
fn landing_ends_on_the_floor_without_force() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    assert_eq!(rig.plain(Function::Takeoff).status, Status::TAKEN_OFF);
    assert_eq!(rig.plain(Function::Land).status, Status::OK);
    assert_eq!((rig.controller.flight, rig.position.z), (Flight::Landed, FLOOR_M));
    assert_eq!(rig.step(), Wrench::ZERO);
    assert_eq!(rig.plain(Function::Land).status, Status::LANDED);
    assert_eq!(rig.status(Request::AxisValues(Function::SetForces, [9.0; 6])), Status::LANDED);
    assert_eq!(rig.step(), Wrench::ZERO);
    assert_eq!(rig.plain(Function::FindGravity), Reply::failed(Some(Function::FindGravity), Status::LANDED));
}

#[test]
fn a_force_command_replaces_the_gains_or_comes_on_top_of_them() {
    let forces = [0.5, -0.25, 5.5, 0.125, -0.0625, 0.25];
    for (kind, on_top) in [(ForceCommand::Replaces, 0.0), (ForceCommand::Adds, 1.0)] {
        let mut rig = Rig::flying(kind);
        let held = f64::from(rig.six(Function::GetForces)[2]);
        assert_eq!(rig.status(Request::AxisValues(Function::SetForces, forces)), Status::OK);
        let found = rig.six(Function::GetForces);
        let expected = 5.5 + on_top * held;
        // The rounding of the wire.
        assert!((f64::from(found[2]) - expected).abs() < 1.0e-6, "{kind:?}: {found:?}");
        // Without gains both are the same, to the bit.
        for set in [GainSet::Normal, GainSet::Locked, GainSet::Constrained] {
            assert_eq!(rig.status(Request::SetGainVecAxes(set, [Pid::ZERO; 6])), Status::OK);
        }
        assert_eq!(rig.six(Function::GetForces), forces, "{kind:?}");
        assert_eq!(rig.status(Request::SetForceAxis(Axis::Y, 1.0)), Status::OK);
        assert_eq!(rig.six(Function::GetForces), [0.5, 1.0, 5.5, 0.125, -0.0625, 0.25]);
    }
}

#[test]
fn locks_hold_and_constraints_push_back() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    let to = |x: f32| WirePose { at: [x, 0.0, 0.0, 0.0, 0.0, 0.0], ..WirePose::default() };
    assert_eq!(rig.status(Request::OfAxis(Function::LockAxis, Axis::X)), Status::OK);
    assert_eq!(rig.status(Request::Pose(Function::SetDesiredPosition, to(3.0e-3))), Status::OK);
    rig.run(1000);
    assert!(rig.position.x.abs() < 1.0e-6, "{}", rig.position.x);
    assert_eq!(rig.status(Request::OfAxis(Function::UnlockAxis, Axis::X)), Status::OK);
    rig.run(1000);
    assert!((rig.position.x - 3.0e-3).abs() < 1.0e-6, "{}", rig.position.x);
    let range = [-1.0e-3, 1.0e-3];
    assert_eq!(rig.status(Request::ConstrainAxis { axis: Axis::X, range }), Status::OK);
    rig.run(1000);
    assert!((rig.position.x - 1.0e-3).abs() < 2.0e-6, "{}", rig.position.x);
    // Beyond the range the constrained gains push back, on top of the normal ones that pull to its edge.
    (rig.position.x, rig.velocity.x) = (1.5e-3, 0.0);
    rig.controller.sense(&rig.sample(), 0.0);
    let back = f64::from(rig.six(Function::GetForces)[0]);
    assert!((back + (2400.0 + 4800.0) * 0.5e-3).abs() < 1.0e-4, "{back}");
}

#[test]
fn a_flotor_is_as_heavy_beyond_a_range_as_inside_it() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    let range = [1.0e-3, 3.0e-3];
    assert_eq!(rig.status(Request::ConstrainAxis { axis: Axis::Z, range }), Status::OK);
    rig.run(1000);
    // Weight less the feed-forward of 3.5 N, over both stiffnesses.
    let expected = 1.0e-3 - (MASS_KG * GRAVITY - 3.5) / (10_000.0 + 15_000.0);
    assert!((rig.position.z - expected).abs() < 1.0e-6, "{}", rig.position.z);
}

#[test]
fn a_flotor_that_rests_at_a_boundary_crosses_it_once() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    rig.run(10);
    let _ = rig.controller.take_events();
    let range = [-1.0e-3, 1.0e-3];
    assert_eq!(rig.status(Request::ConstrainAxis { axis: Axis::X, range }), Status::OK);
    let crossings = |rig: &mut Rig| -> Vec<Event> { rig.controller.take_events().collect() };
    // The sensors' noise is less than their resolution.
    for step in 0..20 {
        rig.position.x = 1.0e-3 + if step % 2 == 0 { 1.0e-6 } else { -1.0e-6 };
        rig.controller.sense(&rig.sample(), 0.0);
    }
    assert_eq!(crossings(&mut rig), [Event::Boundary([1, 0, 0, 0, 0, 0, 0])]);
    rig.position.x = 0.9e-3;
    rig.controller.sense(&rig.sample(), 0.0);
    assert_eq!(crossings(&mut rig), [Event::Boundary([0; 7])]);
    assert_eq!(rig.status(Request::OfAxis(Function::UnlockAxis, Axis::X)), Status::OK);
    assert_eq!(rig.status(Request::Number(Function::SetBoundaryRadius, 0.9e-3)), Status::OK);
    for step in 0..20 {
        rig.position = DVec3::X * (0.9e-3 + if step % 2 == 0 { 1.0e-6 } else { -1.0e-6 });
        rig.controller.sense(&rig.sample(), 0.0);
    }
    assert_eq!(crossings(&mut rig), [Event::Boundary([0, 0, 0, 0, 0, 0, 1])]);
}

#[test]
fn an_integral_gain_acts_from_when_it_is_set_and_takes_the_sag_away() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    rig.run(10_000);
    let (sag, before) = (rig.position.z, rig.six(Function::GetForces)[2]);
    assert!(sag < -1.0e-4, "{sag}");
    let set = Request::SetGainVecSingle(GainSet::Normal, Axis::Z, Gain::I, 20_000.0);
    assert_eq!(rig.status(set), Status::OK);
    rig.step();
    // In a millisecond it adds 20 000 N/(m s) times the sag.
    let step = (rig.six(Function::GetForces)[2] - before).abs();
    assert!(step < 0.01, "a step of {step} N");
    rig.run(10_000);
    assert!(rig.position.z.abs() < 1.0e-6, "{}", rig.position.z);
    // What the integral carries is part of what holds it.
    let gravity = rig.six(Function::FindGravity);
    assert!((f64::from(gravity[2]) - MASS_KG * GRAVITY).abs() < 5.0e-3, "{gravity:?}");
}

#[test]
fn gains_that_are_reset_end_no_landing_and_a_second_landing_waits_for_the_first() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    let procedure_id = |answer: Answer| match answer {
        Answer::When(procedure_id) => procedure_id,
        Answer::Now(reply) => panic!("{reply:?}"),
    };
    let landing = procedure_id(rig.controller.answer(&Request::Plain(Function::Land)));
    rig.run(100);
    let reset =
        procedure_id(rig.controller.answer(&Request::OfSet(Function::ResetGainVecAxes, GainSet::Locked)));
    let second = procedure_id(rig.controller.answer(&Request::Plain(Function::Land)));
    assert_eq!(rig.finish(second).status, Status::OK);
    assert_eq!((rig.controller.flight, rig.position.z), (Flight::Landed, FLOOR_M));
    assert_eq!(rig.finish(landing).status, Status::OK);
    assert_eq!(rig.finish(reset).status, Status::OK);
}

#[test]
fn gravity_is_found_where_the_flotor_is() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    // Carried by a force at some height, and far from where the gains held it; one axis locked beside its target.
    let to = WirePose { at: [1.0e-3, 0.0, 0.0, 0.0, 0.0, 0.0], ..WirePose::default() };
    assert_eq!(rig.status(Request::OfAxis(Function::LockAxis, Axis::X)), Status::OK);
    assert_eq!(rig.status(Request::Pose(Function::SetDesiredPosition, to)), Status::OK);
    let weight = [0.0, 0.0, 5.442_69, 0.0, 0.0, 0.0];
    assert_eq!(rig.status(Request::AxisValues(Function::SetForces, weight)), Status::OK);
    (rig.position, rig.velocity) = (DVec3::Z * 4.0e-3, DVec3::ZERO);
    rig.step();
    let gravity = rig.six(Function::FindGravity);
    assert!((f64::from(gravity[2]) - MASS_KG * GRAVITY).abs() < 5.0e-3, "{gravity:?}");
    assert!(gravity[0].abs() < 5.0e-3, "{gravity:?}");
    assert!((rig.position.z - 4.0e-3).abs() < 1.0e-3, "{}", rig.position.z);
}

#[test]
fn the_boundary_pushes_back_on_top_of_a_force_command() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    assert_eq!(rig.status(Request::Number(Function::SetBoundaryRadius, 4.0e-3)), Status::OK);
    assert_eq!(
        rig.status(Request::AxisValues(Function::SetForces, [0.0, 0.0, 5.0, 0.0, 0.0, 0.0])),
        Status::OK
    );
    (rig.position, rig.velocity) = (DVec3::Z * -5.0e-3, DVec3::ZERO);
    rig.controller.sense(&rig.sample(), 0.0);
    let force = f64::from(rig.six(Function::GetForces)[2]);
    assert!((force - (5.0 + 15_000.0 * 1.0e-3)).abs() < 1.0e-3, "{force}");
}

#[test]
fn a_fault_switches_off_and_stays_until_its_cause_is_gone() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    let limits = [1.0e-9; 6];
    assert_eq!(rig.status(Request::AxisValues(Function::SetSpeedLimits, limits)), Status::OK);
    rig.velocity.x = 1.0e-3;
    rig.step();
    assert_eq!((rig.controller.faults, rig.step()), (FaultBits::OVER_SPEED, Wrench::ZERO));
    assert_eq!(rig.plain(Function::Takeoff).status, Status::SPEED);
    assert_eq!(rig.plain(Function::ResetFault).status, Status::SPEED, "it is falling");
    rig.run(1000);
    assert_eq!(rig.plain(Function::ResetFault).status, Status::OK);
    let faults: Vec<Event> =
        rig.controller.take_events().filter(|event| matches!(event, Event::Fault(_))).collect();
    assert_eq!(faults, [Event::Fault(FaultBits::OVER_SPEED), Event::Fault(FaultBits::NONE)]);
    assert_eq!(rig.status(Request::AxisValues(Function::SetSpeedLimits, [2.0; 6])), Status::OK);
    assert_eq!(rig.plain(Function::Takeoff).status, Status::OK);
}

#[test]
fn values_come_back_as_they_were_set_and_wrong_ones_are_refused() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    let six = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    for (set, get) in [
        (Function::SetGravity, Function::GetGravity),
        (Function::SetSpeedLimits, Function::GetSpeedLimits),
        (Function::SetCurrentLimits, Function::GetCurrentLimits),
    ] {
        assert_eq!(rig.status(Request::AxisValues(set, six)), Status::OK);
        assert_eq!(rig.six(get), six);
    }
    assert_eq!(rig.status(Request::AxisValues(Function::SetCurrents, six)), Status::CURRENT);
    assert_eq!(rig.six(Function::GetCurrents), [1.0, 2.0, 3.0, 3.5, 3.5, 3.5]);
    for (request, status) in [
        (Request::Number(Function::SetServoFrequency, 99.0), Status::FREQUENCY),
        (Request::Number(Function::SetServoFrequency, f32::NAN), Status::FREQUENCY),
        (Request::AxisValues(Function::SetSpeedLimits, [-1.0; 6]), Status::SPEED),
        (Request::AxisValues(Function::SetForces, [f32::INFINITY; 6]), Status::FORCE),
        (Request::SetGainVecSingle(GainSet::Normal, Axis::X, Gain::P, -1.0), Status::GAIN_RANGE),
    ] {
        assert_eq!(rig.status(request), status, "{request:?}");
    }
    let home = Request::Pose(Function::SetDesiredPosition, WirePose::default());
    assert_eq!(rig.status(home), Status::OK);
    let pid = Pid { p: 1.0, i: 2.0, d: 3.0, ff: 4.0 };
    assert_eq!(rig.status(Request::SetGainVecAxis(GainSet::Boundary, Axis::Rz, pid)), Status::OK);
    let one = rig.call(Request::GetGainVecSingle(GainSet::Boundary, Axis::Rz, Gain::D));
    assert_eq!(one, Reply::ok(Results::Number(3.0)));
    assert_eq!(rig.call(Request::OfSet(Function::ResetGainVecAxes, GainSet::Boundary)).status, Status::OK);
    let reset = rig.call(Request::GetGainVecAxis(GainSet::Boundary, Axis::Rz));
    assert_eq!(reset, Reply::ok(Results::Pid(Pid { p: 15.0, i: 0.0, d: 0.15, ff: 0.0 })));
}

#[test]
fn a_users_frame_moves_and_turns_the_pose_and_nothing_else() {
    let mut rig = Rig::flying(ForceCommand::Replaces);
    rig.position = DVec3::new(1.0e-3, 2.0e-3, 3.0e-3);
    rig.controller.observe(&rig.sample());
    let quarter = std::f32::consts::FRAC_PI_2;
    let frame = WirePose { at: [0.5e-3, 0.0, 0.0, 0.0, 0.0, quarter], ..WirePose::default() };
    assert_eq!(rig.status(Request::Pose(Function::SetFrame, frame)), Status::OK);
    assert_eq!(rig.plain(Function::GetFrame), Reply::ok(Results::Pose(frame)));
    // R x - t, with a quarter turn about z: (x, y) becomes (-y, x).
    let expected = [-2.5e-3, 1.0e-3, 3.0e-3, 0.0, 0.0, quarter];
    let told = rig.controller.pose().at;
    assert!(told.iter().zip(expected).all(|(told, expected)| (told - expected).abs() < 1.0e-8), "{told:?}");
    assert_eq!(rig.plain(Function::GetDesiredPosition), Reply::ok(Results::Pose(WirePose::default())));
}

#[test]
fn a_grasp_carries_its_current_within_its_limit_while_the_flotor_levitates() {
    let mut rig = Rig::new(ForceCommand::Replaces);
    assert_eq!(rig.status(Request::Number(Function::SetGraspCurrent, -2.0)), Status::OK);
    assert_eq!(rig.controller.grasp_a(), 0.0, "on the stator");
    let mut rig = Rig::flying(ForceCommand::Replaces);
    assert_eq!(rig.status(Request::Number(Function::SetGraspCurrent, -2.0)), Status::OK);
    assert_eq!(rig.controller.grasp_a(), -2.0);
    assert_eq!(rig.status(Request::Number(Function::SetGraspCurrentLimit, 1.5)), Status::OK);
    assert_eq!(rig.controller.grasp_a(), -1.5);
    rig.controller.inject(FaultBits::OVER_TEMPERATURE);
    rig.step();
    assert_eq!(rig.controller.grasp_a(), 0.0, "a fault takes it away with the levitation");
}
