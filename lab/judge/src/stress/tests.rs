//! Small laws with one known flaw each: the measures meant for it fail, and no other.

use super::{Measure, Part, Setup, Size, StressOptions, StressReport, Verdict, measure_all};
use crate::tally::Merge;
use flotor_hal::abi::{Extensions, Interface, model_entry, model_entry_with};
use flotor_hal::extension::{contact_set, linear_field};
use flotor_hal::{
    Contact, ContactSet, ContactSetModel, DVec3, Demand, ForceModel, Input, LinearField, LinearFieldModel,
    Memory, ModelInfo, Output, Pose, Refusal, Settings, Wrench, rotation_vector,
};
use flotor_loader::Plugin;
use std::io::Write;
use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A force as a function of the pose.
trait Law: Send + 'static {
    const MEMORY: Memory = Memory::Stateless;
    fn wrench(pose: &Pose) -> Wrench;

    /// J, of a law that reports it.
    fn energy(_pose: &Pose) -> f64 {
        f64::NAN
    }
}

/// A law as a plugin.
struct Lawful<L>(PhantomData<L>);

impl<L: Law> ForceModel for Lawful<L> {
    const INFO: ModelInfo =
        ModelInfo::new("lawful", "Lawful", "A law under test").serving(Demand::ALL).with_memory(L::MEMORY);

    fn create(_settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self(PhantomData))
    }

    fn step(&mut self, input: &Input) -> Output {
        let unit = (input.pose.orientation().length() - 1.0).abs() < 1.0e-6;
        if !input.pose.is_finite() || !unit {
            return Output::new(Wrench::ZERO, f64::NAN, flotor_hal::StepStatus::InvalidInput);
        }
        // A spring of a million metres is stretched far enough.
        let position_m = input.pose.position().clamp_length_max(1.0e6);
        let pose = Pose::new(position_m, input.pose.orientation());
        Output::new(L::wrench(&pose), L::energy(&pose), flotor_hal::StepStatus::Ok)
    }
}

/// A plugin without a flaw.
pub(super) fn honest() -> Plugin {
    Plugin::in_process(Box::leak(Box::new(model_entry::<Lawful<Linear>>()))).unwrap()
}

/// A fraction of a short run: every kind of pose, some of each.
fn stress<L: Law>() -> StressReport {
    let plugin = Plugin::in_process(Box::leak(Box::new(model_entry::<Lawful<L>>()))).unwrap();
    let part = 10 * super::part_of(Size::Short, L::MEMORY);
    let options = StressOptions::default();
    measure_all(&Setup { plugin: &plugin, settings: &[], options, part, progress: &() }).unwrap()
}

/// These parts of a short run.
fn stress_with<M: ForceModel>(options: StressOptions, parts: &[Part]) -> StressReport {
    let plugin = Plugin::in_process(Box::leak(Box::new(model_entry::<M>()))).unwrap();
    let part = super::part_of(Size::Short, plugin.create_model(&[]).unwrap().memory());
    let setup = Setup { plugin: &plugin, settings: &[], options, part, progress: &() };
    let mut found = super::parts::Found::default();
    for part in parts {
        found.merge(super::parts::measure(&setup, *part).unwrap());
    }
    StressReport::new(&setup, found.measures, found.spread)
}

/// Whether a test that takes more than a second of a core is left out; tells so, past the harness. The variable is that of
/// `flotor_tests::TestSize`, a crate that depends on this one.
fn leaves_out_long_tests() -> bool {
    let is_long =
        std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| ["daily", "full"].contains(&size.as_str()));
    if !is_long {
        let thread = std::thread::current();
        let _ = writeln!(
            std::io::stderr(),
            "skipped: {}: takes longer than others: `FLOTOR_TEST_SIZE=daily`, as in `.ci/run`, has it",
            thread.name().unwrap_or("a test")
        );
    }
    !is_long
}

fn measure<'a>(report: &'a StressReport, id: &str) -> &'a Measure {
    report.measures.iter().find(|measure| measure.id == id).unwrap()
}

fn value(report: &StressReport, id: &str, name: &str) -> f64 {
    measure(report, id).values.iter().find(|quantity| quantity.name == name).unwrap().value
}

fn with(report: &StressReport, verdict: Verdict) -> Vec<&str> {
    let with = report.measures.iter().filter(|measure| measure.verdict == verdict);
    with.map(|measure| measure.id.as_ref()).collect()
}

/// Stiffness of the test springs, N/m; the same about the lever arm, so that all six directions are alike.
const STIFFNESS_N_PER_M: f64 = 500.0;

/// An isotropic spring of this stiffness. Its torque `-k r`, `r` the rotation vector, is the gradient of `k
/// r²/2`: the left Jacobian of the rotations leaves `r` alone.
fn spring(pose: &Pose, stiffness_n_per_m: f64) -> Wrench {
    let torsion = stiffness_n_per_m * super::LEVER_M * super::LEVER_M;
    Wrench::new(pose.position() * -stiffness_n_per_m, rotation_vector(pose.orientation()) * -torsion)
}

/// What it stores.
fn stored_j(pose: &Pose) -> f64 {
    let turned_m = rotation_vector(pose.orientation()) * super::LEVER_M;
    0.5 * STIFFNESS_N_PER_M * (pose.position().length_squared() + turned_m.length_squared())
}

struct Linear;
impl Law for Linear {
    fn wrench(pose: &Pose) -> Wrench {
        spring(pose, STIFFNESS_N_PER_M)
    }

    fn energy(pose: &Pose) -> f64 {
        stored_j(pose)
    }
}

#[test]
fn an_honest_spring_passes_everything() {
    let report = stress::<Linear>();
    assert_eq!(with(&report, Verdict::Pass).len(), 10, "{}", report.to_text());
    assert_eq!(report.score, 1.0);
    // Isotropic and linear: the gain is the stiffness, to the rounding of differences.
    let gain = value(&report, "M2", "force by shift");
    assert!((gain / STIFFNESS_N_PER_M - 1.0).abs() < 1.0e-8, "{gain}");
    // About the lever arm too, but for (a/2) / sin(a/2) of a rotation vector's derivative at angle a <= 0.212
    // rad.
    let gain = measure(&report, "M2").value;
    assert!((1.0..1.0019).contains(&(gain / STIFFNESS_N_PER_M)), "{gain}");
    assert_eq!(value(&report, "M2", "renderable share, b = 0.5 N s/m"), 1.0);
    // A zero-order hold of a linear force needs a damping of k T / 2 (Colgate and Schenkel), at most the same part more.
    let damping = measure(&report, "M5").value;
    assert!((1.0..1.0019).contains(&(damping / (0.5 * STIFFNESS_N_PER_M * 1.0e-3))), "{damping}");
}

#[test]
fn the_closed_loop_tips_over_where_theory_says() {
    if leaves_out_long_tests() {
        return;
    }
    // Exact limits of a 580 g flotor, where the spectral radius of the sampled linear loop reaches one, N/m.
    let report = stress::<Linear>();
    let exact = [
        ("b = 0.5 N s/m, delay 0", 1000.1),
        ("b = 2 N s/m, delay 0", 4002.3),
        ("b = 0.5 N s/m, delay 1", 333.4),
    ];
    for (case, exact) in exact {
        let seen = value(&report, "M6", &format!("stiffness limit, {case}"));
        // The growth that can be seen in ten seconds tells the limit to 1 %.
        assert!((seen / exact - 1.0).abs() < 0.02, "{case}: {seen}");
    }
}

/// One percent more energy than work.
struct Boastful;
impl Law for Boastful {
    fn wrench(pose: &Pose) -> Wrench {
        spring(pose, STIFFNESS_N_PER_M)
    }

    fn energy(pose: &Pose) -> f64 {
        1.01 * stored_j(pose)
    }
}

#[test]
fn an_energy_that_is_not_the_work_is_found() {
    let report = stress::<Boastful>();
    assert_eq!(with(&report, Verdict::Fail), ["M4"], "{}", report.to_text());
    let seen = value(&report, "M4", "largest difference of energy and work, of what is stored");
    // A hundredth of what was stored, of which the model reports 1.01; the trapezoidal rule adds half its tolerance at most.
    assert!((seen - 0.01 / 1.01).abs() < 5.0e-4, "{seen}");
}

/// Its torque turns the handle away from where its energy is least.
struct TurnsAway;
impl Law for TurnsAway {
    fn wrench(pose: &Pose) -> Wrench {
        let pull = spring(pose, 0.2 * STIFFNESS_N_PER_M);
        Wrench::new(pull.force(), -pull.torque())
    }

    fn energy(pose: &Pose) -> f64 {
        0.2 * stored_j(pose)
    }
}

#[test]
fn a_torque_of_the_wrong_sign_is_found_by_its_energy_and_where_it_comes_to_rest() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<TurnsAway>();
    for id in ["M4", "M6"] {
        assert_eq!(measure(&report, id).verdict, Verdict::Fail, "{}", report.to_text());
    }
}

/// Finite everywhere but at quaternions that are no rotations.
struct Trusting;
impl ForceModel for Trusting {
    const INFO: ModelInfo = ModelInfo::new("trusting", "Trusting", "A model under test");

    fn create(_settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    fn step(&mut self, input: &Input) -> Output {
        let norm = input.pose.orientation().length();
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, f64::NAN, flotor_hal::StepStatus::InvalidInput);
        }
        let wrong = if (norm - 1.0).abs() > 1.0e-3 { f64::NAN } else { 1.0 };
        (spring(&Pose::new(input.pose.position().clamp_length_max(1.0e6), Pose::HOME.orientation()), 100.0)
            * wrong)
            .into()
    }
}

#[test]
fn a_pose_that_is_no_rotation_is_printed_as_it_was_given() {
    let plugin = Plugin::in_process(Box::leak(Box::new(model_entry::<Trusting>()))).unwrap();
    let part = 10 * super::part_of(Size::Short, Memory::Stateless);
    let options = StressOptions::default();
    let setup = Setup { plugin: &plugin, settings: &[], options, part, progress: &() };
    let measure = super::totality::measure(&setup).unwrap();
    assert_eq!(measure.verdict, Verdict::Fail);
    let [i, j, k, w] = measure.pose.unwrap().orientation_xyzw.expect("it is no rotation");
    assert!((i * i + j * j + k * k + w * w - 1.0).abs() > 1.0e-3);
}

/// A spring with a field on top, `U = k x²/2 + c x . (R a)`: conservative, and its torque is far from zero.
struct Lever;
impl Law for Lever {
    fn wrench(pose: &Pose) -> Wrench {
        let arm_n = pose.orientation() * DVec3::new(0.3, -0.2, 0.4);
        spring(pose, STIFFNESS_N_PER_M) + Wrench::new(-arm_n, -arm_n.cross(pose.position()))
    }
}

#[test]
fn torque_of_a_conservative_law_is_not_taken_for_asymmetry() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Lever>();
    assert!(with(&report, Verdict::Fail).is_empty(), "{}", report.to_text());
}

struct Walked;
impl Law for Walked {
    const MEMORY: Memory = Memory::PathDependent;
    fn wrench(pose: &Pose) -> Wrench {
        spring(pose, STIFFNESS_N_PER_M)
    }
}

#[test]
fn a_model_with_memory_is_walked_and_judged_alike() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Walked>();
    assert_eq!(with(&report, Verdict::Pass).len(), 10, "{}", report.to_text());
}

struct Jumping;
impl Law for Jumping {
    fn wrench(pose: &Pose) -> Wrench {
        let step_n = if pose.position().z > 3.0e-3 { -0.5 } else { 0.0 };
        spring(pose, STIFFNESS_N_PER_M) + Wrench::from_force(DVec3::Z * step_n)
    }
}

#[test]
fn a_jump_is_found_and_measured() {
    let report = stress::<Jumping>();
    assert_eq!(with(&report, Verdict::Fail), ["M1", "M9"], "{}", report.to_text());
    let worst = measure(&report, "M1");
    // The step, plus what the spring adds over 1e-8 mm.
    assert!((worst.value - 0.5).abs() < 1.0e-7, "{}", worst.value);
    let z_m = worst.pose.unwrap().position_m[2];
    assert!((z_m - 3.0e-3).abs() < 1.0e-10, "closed in to the last piece: {z_m}");
}

struct Swirling;
impl Law for Swirling {
    fn wrench(pose: &Pose) -> Wrench {
        let around = DVec3::Z.cross(pose.position());
        spring(pose, STIFFNESS_N_PER_M) + Wrench::from_force(around)
    }
}

#[test]
fn a_swirl_is_neither_reciprocal_nor_conservative() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Swirling>();
    assert_eq!(with(&report, Verdict::Fail), ["M3", "M4", "M9"], "{}", report.to_text());
    // J - J^T has two entries of 2 N/m; J is k times the identity and two entries of 1 N/m.
    let expected = 8.0_f64.sqrt() / (6.0 * STIFFNESS_N_PER_M.powi(2) + 2.0).sqrt();
    assert!((measure(&report, "M3").value / expected - 1.0).abs() < 1.0e-4);
}

struct Forgetful;
impl Law for Forgetful {
    fn wrench(pose: &Pose) -> Wrench {
        // Turning pushes, pushing does not turn. 0.05 N/rad.
        let pitch_rad = rotation_vector(pose.orientation()).x;
        spring(pose, STIFFNESS_N_PER_M) + Wrench::from_force(DVec3::Y * 0.05 * pitch_rad)
    }
}

#[test]
fn a_forgotten_coupling_breaks_reciprocity_and_can_be_pumped() {
    let report = stress::<Forgetful>();
    assert_eq!(with(&report, Verdict::Fail), ["M3", "M4", "M9"], "{}", report.to_text());
}

struct NeverAnswers;
impl Law for NeverAnswers {
    fn wrench(_pose: &Pose) -> Wrench {
        Wrench::from_force(DVec3::NAN)
    }
}

#[test]
fn no_answer_is_no_pass() {
    let report = stress::<NeverAnswers>();
    assert_eq!(with(&report, Verdict::Fail), ["M0", "M9"], "{}", report.to_text());
    // It is quick about it, and NaN after NaN.
    assert_eq!(with(&report, Verdict::Pass), ["M7", "M8"], "{}", report.to_text());
}

struct NothingAtHome;
impl Law for NothingAtHome {
    fn wrench(pose: &Pose) -> Wrench {
        if pose.position() == DVec3::ZERO && pose.orientation().xyz() == DVec3::ZERO {
            return Wrench::from_force(DVec3::NAN);
        }
        spring(pose, STIFFNESS_N_PER_M)
    }
}

#[test]
fn nan_at_home_is_named() {
    let report = stress::<NothingAtHome>();
    assert_eq!(with(&report, Verdict::Fail), ["M0", "M9"], "{}", report.to_text());
    let totality = measure(&report, "M0");
    assert_eq!(totality.pose.unwrap().position_m, [0.0; 3]);
    assert!(totality.comment.contains("home"), "{}", totality.comment);
}

struct PanicsAtHome;
impl Law for PanicsAtHome {
    fn wrench(pose: &Pose) -> Wrench {
        assert!(pose.position() != DVec3::ZERO || pose.orientation().xyz() != DVec3::ZERO, "no law at home");
        spring(pose, STIFFNESS_N_PER_M)
    }
}

#[test]
fn a_panic_is_named_and_the_score_goes_on() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<PanicsAtHome>();
    assert_eq!(with(&report, Verdict::Fail), ["M0", "M9"], "{}", report.to_text());
    assert!(measure(&report, "M0").comment.contains("no law at home"));
    assert!(value(&report, "M0", "panics") >= 1.0);
    assert_eq!(measure(&report, "M4").verdict, Verdict::Pass);
}

struct Stiff;
impl Law for Stiff {
    fn wrench(pose: &Pose) -> Wrench {
        spring(pose, 10.0 * STIFFNESS_N_PER_M)
    }
}

#[test]
fn a_stiff_spring_is_too_stiff_for_a_sampled_loop() {
    // 2 b / T = 4000 N/m at most, and k T / 2 = 2.5 N s/m of damping: one condition seen from both ends.
    let report = stress::<Stiff>();
    assert_eq!(with(&report, Verdict::Fail), ["M2", "M5"], "{}", report.to_text());
    assert_eq!(value(&report, "M2", "renderable share, b = 2 N s/m"), 0.0);
}

struct Whirling;
impl Law for Whirling {
    fn wrench(pose: &Pose) -> Wrench {
        // A circular force that beats the damping: b sqrt(k / m) = 7 N/m.
        let around = DVec3::Z.cross(pose.position()) * 60.0;
        spring(pose, 0.2 * STIFFNESS_N_PER_M) + Wrench::from_force(around)
    }
}

#[test]
fn a_soft_model_that_diverges_has_no_excuse() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Whirling>();
    assert_eq!(measure(&report, "M6").verdict, Verdict::Fail, "{}", report.to_text());
    assert!(measure(&report, "M2").value < 1000.0);
}

struct Weight;
impl Law for Weight {
    fn wrench(_pose: &Pose) -> Wrench {
        Wrench::from_force(DVec3::Z * -3.0)
    }
}

#[test]
fn a_weight_is_carried_off_and_does_not_diverge() {
    let report = stress::<Weight>();
    // It is as heavy everywhere: no equilibrium, and no derivative that could be symmetric.
    assert_eq!(with(&report, Verdict::NothingToJudge), ["M3", "M6"], "{}", report.to_text());
    assert_eq!(value(&report, "M6", "releases carried off"), value(&report, "M6", "releases"));
    assert!(with(&report, Verdict::Fail).is_empty(), "{}", report.to_text());
}

/// No wrench anywhere.
struct Absent;
impl Law for Absent {
    fn wrench(_pose: &Pose) -> Wrench {
        Wrench::ZERO
    }
}

#[test]
fn a_model_that_does_nothing_passes_nothing_that_is_about_its_force() {
    let options = StressOptions { symmetry: Some(super::Symmetry::MirrorX), ..StressOptions::default() };
    let report = stress_with::<Lawful<Absent>>(options, &[Part::Stiffness, Part::Loops, Part::Symmetry]);
    assert_eq!(with(&report, Verdict::NothingToJudge), ["M3", "M4", "M10"], "{}", report.to_text());
    let text = report.to_text();
    assert!(text.contains("nothing to judge M3") && text.contains("3 not judged"), "{text}");
}

/// A wall of 2 or 100 kN/m, without friction.
struct Wall<const STIFFNESS_N_PER_M: u32>;
impl<const STIFFNESS_N_PER_M: u32> Law for Wall<STIFFNESS_N_PER_M> {
    fn wrench(pose: &Pose) -> Wrench {
        Wrench::from_force(DVec3::Z * (-pose.position().z).max(0.0) * f64::from(STIFFNESS_N_PER_M))
    }
}

/// A floor of 2 kN/m at home, in the loop or asynchronously; the length of its normal is `LENGTH`.
struct Floor<const LENGTH: u32 = 1>;

impl<const LENGTH: u32> Floor<LENGTH> {
    fn force_n(input: &Input) -> DVec3 {
        DVec3::Z * (-2000.0 * input.pose.position().z).max(0.0)
    }
}

impl<const LENGTH: u32> ForceModel for Floor<LENGTH> {
    const INFO: ModelInfo = ModelInfo::new("floor", "Floor", "A floor under test");

    fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    fn step(&mut self, input: &Input) -> Output {
        Wrench::from_force(Self::force_n(input)).into()
    }
}

impl<const LENGTH: u32> ContactSetModel for Floor<LENGTH> {
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let mut floor = Contact::of_handle(input, DVec3::Z, input.pose.position().z, 2000.0);
        floor.normal[2] = f64::from(LENGTH);
        ContactSet::at(input).with(floor)
    }
}

impl LinearFieldModel for Floor {
    fn linear_field(&mut self, input: &Input) -> LinearField {
        let force_n = Self::force_n(input);
        let slope_n_per_m = if force_n.z > 0.0 { DVec3::Z * -2000.0 } else { DVec3::ZERO };
        LinearField::of_force(input, force_n, [DVec3::ZERO, DVec3::ZERO, slope_n_per_m], 0.01)
    }
}

struct Contacts;
impl<const LENGTH: u32> Extensions<Floor<LENGTH>> for Contacts {
    const LIST: &'static [Interface<Floor<LENGTH>>] = &[contact_set::offer()];
}

struct Field;
impl Extensions<Floor> for Field {
    const LIST: &'static [Interface<Floor>] = &[linear_field::offer()];
}

/// A short M11.
fn asynchronous<M: ForceModel, E: Extensions<M>>() -> StressReport {
    let plugin = Plugin::in_process(Box::leak(Box::new(model_entry_with::<M, E>()))).unwrap();
    let part = super::part_of(Size::Short, Memory::Stateless);
    let options = StressOptions::default();
    let setup = Setup { plugin: &plugin, settings: &[], options, part, progress: &() };
    let found = super::parts::measure(&setup, Part::Asynchronous).unwrap();
    StressReport::new(&setup, found.measures, found.spread)
}

#[test]
fn contacts_never_pull_and_a_field_that_leaves_a_floor_does() {
    let contacts = asynchronous::<Floor, Contacts>();
    let report = contacts.to_text();
    assert_eq!(with(&contacts, Verdict::Pass), ["M11"], "{report}");
    assert!(value(&contacts, "M11", "ticks with a force") > 1000.0, "{report}");
    for rate in ["50", "100", "200", "500"] {
        let number = |name: &str| value(&contacts, "M11", &format!("{name}, {rate} Hz"));
        assert_eq!((number("pull"), number("ticks that pull")), (0.0, 0.0));
        let [given_mj, in_loop_mj] = ["energy given to the hand", "energy given in the loop"].map(number);
        assert!(in_loop_mj > 0.0 && given_mj <= 1.15 * in_loop_mj + 0.02, "{given_mj} of {in_loop_mj} mJ");
    }
    let field = asynchronous::<Floor, Field>();
    assert_eq!(with(&field, Verdict::Note), ["M11"], "{}", field.to_text());
    let pull_n = |rate: &str| value(&field, "M11", &format!("pull, {rate} Hz"));
    assert!(pull_n("50") > pull_n("500") && pull_n("500") > 0.01, "{} {}", pull_n("50"), pull_n("500"));
    assert!(value(&field, "M11", "oldest answer, 50 Hz") >= 40.0, "an answer is used for two periods");
}

#[test]
fn contacts_that_are_refused_fail_with_the_reason() {
    let report = asynchronous::<Floor<2>, Contacts>();
    assert_eq!(with(&report, Verdict::Fail), ["M11"], "{}", report.to_text());
    let comment = &measure(&report, "M11").comment;
    assert!(comment.contains("refused") && comment.contains("`normal`"), "{comment}");
}

#[test]
fn a_model_of_the_loop_alone_is_no_asynchronous_one() {
    let report = asynchronous::<Floor, ()>();
    assert_eq!(with(&report, Verdict::NothingToJudge), ["M11"], "{}", report.to_text());
}

#[test]
fn the_damping_that_a_wall_needs_is_half_its_stiffness_times_the_period() {
    for (report, expected) in [
        (stress_with::<Lawful<Wall<2_000>>>(StressOptions::default(), &[Part::Stiffness]), 1.0),
        (stress_with::<Lawful<Wall<100_000>>>(StressOptions::default(), &[Part::Stiffness]), 50.0),
    ] {
        let damping = measure(&report, "M5");
        // To the rounding of differences.
        assert!((damping.value / expected - 1.0).abs() < 1.0e-6, "{}", report.to_text());
        // Two lines of one table say one thing.
        assert_eq!(damping.verdict, measure(&report, "M2").verdict, "{}", report.to_text());
        assert_ne!(damping.verdict, Verdict::Pass);
    }
}

#[test]
fn the_work_of_every_lap_through_a_surface_is_known() {
    let report = stress_with::<Lawful<Wall<2_000>>>(StressOptions::default(), &[Part::Loops]);
    assert_eq!(measure(&report, "M4").verdict, Verdict::Pass, "{}", report.to_text());
    let [laps, known] =
        ["laps where work is exchanged", "laps known to the bound"].map(|name| value(&report, "M4", name));
    assert!(laps > 100.0 && known == laps, "{}", report.to_text());
}

/// Ribs 0.73 µm wide on one half of the workspace: every difference crosses some of them.
struct Ribbed;
impl Law for Ribbed {
    fn wrench(pose: &Pose) -> Wrench {
        // No whole number of them in any difference.
        let ribs = pose.position().x / 0.73e-6;
        let height = if ribs < 0.0 { (ribs - ribs.round()).abs() } else { 0.0 };
        spring(pose, STIFFNESS_N_PER_M) + Wrench::from_force(DVec3::X * height * 0.1)
    }
}

#[test]
fn a_law_without_a_derivative_on_half_of_the_workspace_is_not_resolved() {
    let report = stress_with::<Lawful<Ribbed>>(StressOptions::default(), &[Part::Stiffness]);
    let reciprocity = measure(&report, "M3");
    assert_eq!(reciprocity.verdict, Verdict::NotResolved, "{}", report.to_text());
    let [poses, known] = ["poses", "poses known to the bound"].map(|name| value(&report, "M3", name));
    assert!(known < 0.6 * poses && known > 0.4 * poses, "{}", report.to_text());
}

/// A wall of 1 MN/m or 2 kN/m with friction, as a proxy on its surface makes it. Where damping relieves a handle that
/// leaves, the force is clamped to the cone and the proxy stays: the spring along the surface returns what the handle never
/// stored.
struct Rubbing<const STIFFNESS_N_PER_M: u32, const DAMPING_NS_PER_M: u32> {
    proxy_m: Option<DVec3>,
}

impl<const K: u32, const B: u32> ForceModel for Rubbing<K, B> {
    const INFO: ModelInfo =
        ModelInfo::new("rubbing", "Rubbing", "A wall under test").with_memory(Memory::PathDependent);

    fn create(_settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self { proxy_m: None })
    }

    fn reset(&mut self) {
        self.proxy_m = None;
    }

    fn step(&mut self, input: &Input) -> Output {
        let (handle_m, velocity) = (input.pose.position(), input.twist.linear());
        let depth_m = -handle_m.z;
        if depth_m <= 0.0 || depth_m.is_nan() {
            self.proxy_m = None;
            return Wrench::ZERO.into();
        }
        let (stiffness, damping) = (f64::from(K), f64::from(B));
        let above_m = DVec3::new(handle_m.x, handle_m.y, 0.0);
        let along_m = (self.proxy_m.unwrap_or(above_m) - above_m).clamp_length_max(depth_m);
        self.proxy_m = Some(above_m + along_m);
        let normal_n = (stiffness * depth_m - damping * velocity.z).max(0.0);
        let along_n = (along_m * stiffness).clamp_length_max(normal_n);
        Wrench::from_force(along_n + DVec3::Z * normal_n).into()
    }
}

#[test]
fn a_wall_with_friction_is_judged_by_the_differences_that_were_seen() {
    let report = stress_with::<Rubbing<1_000_000, 0>>(StressOptions::default(), &[Part::Stiffness]);
    // It sticks: its stiffness along the surface and across it, and no more than both together where it slides.
    let range = 1.0e6 * (1.0 - 1.0e-9)..1.0e6 * 2.0_f64.sqrt() * (1.0 + 1.0e-9);
    let gain = measure(&report, "M2");
    assert!(range.contains(&gain.value) && gain.verdict == Verdict::Fail, "{}", report.to_text());
    let damping = measure(&report, "M5");
    assert!((damping.value / 500.0 - 1.0).abs() < 1.0e-9, "{}", report.to_text());
    assert_ne!(measure(&report, "M3").verdict, Verdict::Pass, "{}", report.to_text());
}

#[test]
fn a_force_that_is_clamped_where_its_state_is_not_generates_energy_in_motion_only() {
    let pumps = stress_with::<Rubbing<2_000, 100>>(StressOptions::default(), &[Part::Search]);
    let made = value(&pumps, "M9", "largest energy of a lap in motion, of all work exchanged");
    assert!(made > 0.01 && measure(&pumps, "M9").verdict == Verdict::Fail, "{}", pumps.to_text());
    // Each to rounding: the bound of M4.
    let at_rest = value(&pumps, "M9", "largest energy of a lap, of what its forces could do");
    assert!(at_rest <= super::lap::CONSERVATIVE, "{}", pumps.to_text());
    let rubs = stress_with::<Rubbing<2_000, 0>>(StressOptions::default(), &[Part::Search]);
    let made = value(&rubs, "M9", "largest energy of a lap in motion, of all work exchanged");
    assert!(made <= super::lap::CONSERVATIVE, "{}", rubs.to_text());
}

struct Slow;
impl Law for Slow {
    fn wrench(pose: &Pose) -> Wrench {
        // Twice the bound, in a corner that few measures visit.
        if pose.position().z > 29.0e-3 && pose.position().z < 31.0e-3 {
            let begin = Instant::now();
            while begin.elapsed() < Duration::from_micros(200) {}
        }
        spring(pose, STIFFNESS_N_PER_M)
    }
}

#[test]
fn a_slow_corner_is_found() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Slow>();
    assert_eq!(with(&report, Verdict::Fail), ["M7"], "{}", report.to_text());
    let z_m = measure(&report, "M7").pose.unwrap().position_m[2];
    assert!(z_m > 29.0e-3, "{z_m}");
}

static CALLS: AtomicU64 = AtomicU64::new(0);

struct Moody;
impl Law for Moody {
    fn wrench(pose: &Pose) -> Wrench {
        // Another answer every time, by less than anybody feels.
        let mood = CALLS.fetch_add(1, Ordering::Relaxed) % 3;
        let whim_n = if mood == 1 { 1.0e-10 } else { 0.0 };
        spring(pose, STIFFNESS_N_PER_M) + Wrench::from_force(DVec3::X * whim_n)
    }
}

#[test]
fn answers_that_depend_on_nothing_are_found() {
    if leaves_out_long_tests() {
        return;
    }
    let report = stress::<Moody>();
    assert_eq!(with(&report, Verdict::Fail), ["M8"], "{}", report.to_text());
}

#[test]
fn the_same_seed_gives_the_same_score() {
    if leaves_out_long_tests() {
        return;
    }
    let (first, second) = (stress::<Lever>(), stress::<Lever>());
    for (a, b) in first.measures.iter().zip(&second.measures).filter(|(a, _)| a.id != "M7") {
        // Compared as text: absent numbers are NaN, which differs from itself.
        assert_eq!(serde_json::to_string(a).unwrap(), serde_json::to_string(b).unwrap());
    }
}

#[test]
fn the_picture_shows_all_four_distributions() {
    let svg = stress::<Linear>().to_svg();
    for words in ["M1", "M2", "M4", "M7", "score"] {
        assert!(svg.contains(words), "{words}");
    }
    assert!(!svg.contains("no data"), "every panel has something to show");
}
