//! One energy from two laws: what is felt is its gradient everywhere, and nothing jumps where they meet.

use crate::printed::assert_chapter_prints;
use crate::sample::{Sampler, of};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Accuracy, Rod};
use flotor_spring::rod_blend::{RodBlend, TOLERANCE_N};
use flotor_spring::validity::Validity;
use std::time::Instant;

/// Poses of a hand that turns the plate by up to 30 degrees in all and shoves it by up to 0.24 free lengths, from stretched
/// to `most` of the way to nothing.
fn reached(spring: &Spring, most: f64, count: u32) -> Vec<(DVec3, DVec3)> {
    let (mut sampler, free_length_m) = (Sampler::new(2026), spring.geometry().free_length_m);
    let mut poses = Vec::new();
    while poses.len() < count as usize {
        let (aside, turned) = (sampler.vector([1.0, 1.0, 0.0]), sampler.vector([1.0; 3]));
        let down = 0.5 * (most - 0.2) + 0.5 * (most + 0.2) * sampler.signed();
        if aside.length() < 1.0 && turned.length() < 1.0 {
            let position_m = (0.24 * aside - DVec3::Z * down) * free_length_m;
            poses.push((position_m, 30f64.to_radians() * turned));
        }
    }
    poses
}

/// The exact rod at a pose, walked there.
fn exact(
    spring: &Spring,
    accuracy: Accuracy,
    (position_m, rotation_rad): (DVec3, DVec3),
) -> Option<Response> {
    let mut rod = Rod::new(spring, accuracy);
    for step in 0..=400 {
        let part = (f64::from(step) / 100.0).min(1.0);
        let answer = rod.step(
            &Pose::from_rotation_vector(position_m * part, rotation_rad * part),
            Demand::WrenchAndEnergy,
        );
        if part >= 1.0 && answer.validity == Validity::Ok {
            return Some(answer);
        }
    }
    None
}

/// Where the time of a pose is measured.
#[derive(Clone, Copy)]
enum Region {
    /// All of it.
    Reached,
    /// All of it, turned by 30 degrees.
    FarTurned,
    /// A fifth of the way, turned by 2 degrees.
    NearHome,
}

/// What a pose takes, cold, µs: the fastest of a hundred rounds. Printed, not asserted.
fn time_us(spring: &Spring, most: f64, region: Region) -> f64 {
    let turned = |(position_m, rotation_rad): (DVec3, DVec3)| {
        let direction = rotation_rad.normalize_or_zero();
        let (part, rotation_rad) = match region {
            Region::Reached => (1.0, rotation_rad),
            Region::FarTurned => (1.0, direction * 30f64.to_radians()),
            Region::NearHome => (0.2, direction * 2f64.to_radians()),
        };
        Pose::from_rotation_vector(position_m * part, rotation_rad)
    };
    let poses: Vec<Pose> = reached(spring, most, 200).into_iter().map(turned).collect();
    let mut law = RodBlend::new(spring);
    let rounds = (0..100).map(|_| {
        let begin = Instant::now();
        for pose in &poses {
            let _ = std::hint::black_box(law.respond(std::hint::black_box(pose), Demand::Wrench));
        }
        begin.elapsed().as_secs_f64() * 1e6 / poses.len() as f64
    });
    rounds.fold(f64::INFINITY, f64::min)
}

/// The name of a preset in the tables of the book.
fn in_tables(preset: Preset) -> String {
    match preset {
        Preset::Slender => "`slender`".to_owned(),
        thesis => thesis.name().replace("thesis-", "spring "),
    }
}

/// Up to rotations of 30 degrees, however the axis points, full shear, and as far down as the coils or buckling allow: five
/// millinewtons, what a position that is known to ten micrometres is worth.
#[test]
fn the_default_law_is_the_rod_to_five_millinewtons() {
    let mut rows = Vec::new();
    // Springs 1 and 2 to short of their solid lengths at 70 and 80 %, the others to short of buckling at 54.5 and 8.28 %.
    for (preset, most) in Preset::ALL.into_iter().zip([0.68, 0.68, 0.54, 0.082]) {
        let spring = preset.spring();
        let (mut law, unblended, count) = (RodBlend::new(&spring), EnergyForm::new(&spring), of(1000, 60));
        // The servo's rod errs by less than 1e-4 N, a fiftieth of the bound.
        let accuracy = if count == 1000 { Accuracy::Tight } else { Accuracy::Servo };
        let (mut worst_n, mut worst_nm, mut unblended_n, mut answered) = (0.0f64, 0.0f64, 0.0f64, 0);
        for (position_m, rotation_rad) in reached(&spring, most, count) {
            let Some(truth) = exact(&spring, accuracy, (position_m, rotation_rad)) else { continue };
            answered += 1;
            law.reset();
            let pose = Pose::from_rotation_vector(position_m, rotation_rad);
            let answer = law.respond(&pose, Demand::WrenchAndEnergy);
            assert_eq!(answer.validity, Validity::Ok, "{preset:?} {pose:?}");
            worst_n = worst_n.max((answer.force_n - truth.force_n).length());
            worst_nm = worst_nm.max((answer.torque_nm - truth.torque_nm).length());
            let unblended = unblended.respond(&pose, Demand::Force);
            unblended_n = unblended_n.max((unblended.force_n - truth.force_n).length());
        }
        if count == 1000 {
            let name = in_tables(preset);
            let row = format!("| {name} | {worst_n:.1e} | {worst_nm:.1e} | {unblended_n:.1e} |");
            println!("{row}");
            rows.push(row);
        }
        let regions = [Region::Reached, Region::FarTurned, Region::NearHome];
        let [all_us, far_us, near_us] = regions.map(|region| time_us(&spring, most, region));
        println!(
            "{preset:?}: {answered} poses, error up to {worst_n:.1e} N, {worst_nm:.1e} N m; {all_us:.2} µs a pose, {far_us:.2} \
             turned by 30 degrees, {near_us:.2} near home"
        );
        assert!(answered * 20 > 19 * count, "{preset:?}: {answered} of {count}");
        assert!(worst_n < 5e-3, "{preset:?}: {worst_n:e} N");
        // A lever of a tenth of a metre.
        assert!(worst_nm < 0.1 * TOLERANCE_N, "{preset:?}: {worst_nm:e} N m");
    }
    rows.iter().for_each(|row| assert_chapter_prints("models/spring/energy.md", row));
}

/// Relative lengths of the chord at which the springs buckle, by Haringx: 54.5 and 8.28 % of compression.
const BUCKLED: [f64; 4] = [0.0, 0.0, 0.455, 0.9172];

/// Poses uniform in the device's workspace: 12 mm about home in units of the free length over 15 mm, and 7 degrees.
fn in_the_workspace(spring: &Spring, count: u32) -> Vec<(DVec3, DVec3)> {
    let (mut sampler, free_length_m) = (Sampler::new(9), spring.geometry().free_length_m);
    let mut ball = || loop {
        let point = sampler.vector([1.0; 3]);
        if point.length() < 1.0 {
            return point;
        }
    };
    let poses = (0..count).map(|_| (0.8 * free_length_m * ball(), 7f64.to_radians() * ball()));
    poses.collect()
}

/// Mean time of a cold answer at poses, ns: the fastest of five rounds. Printed, not asserted.
fn mean_ns(law: &mut RodBlend, poses: &[Pose]) -> f64 {
    let rounds = (0..5).map(|_| {
        let begin = Instant::now();
        for pose in poses {
            let _ = std::hint::black_box(law.respond(std::hint::black_box(pose), Demand::Wrench));
        }
        begin.elapsed().as_secs_f64() * 1e9 / poses.len() as f64
    });
    rounds.fold(f64::INFINITY, f64::min)
}

/// Short of buckling the law is the rod to the tolerance over the whole workspace, and springs that never buckle seldom need the rod.
#[test]
fn over_the_whole_workspace_the_law_keeps_to_its_tolerance_and_seldom_needs_the_rod() {
    let mut rows = Vec::new();
    for (preset, buckled) in Preset::ALL.into_iter().zip(BUCKLED) {
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        let (mut law, count) = (RodBlend::within(&spring, TOLERANCE_N), of(10_000, 400));
        let (mut worst_n, mut worst_nm, mut compared, mut shared) = (0.0f64, 0.0f64, 0, 0);
        let poses = in_the_workspace(&spring, count);
        for &(position_m, rotation_rad) in &poses {
            law.reset();
            let answer =
                law.respond(&Pose::from_rotation_vector(position_m, rotation_rad), Demand::WrenchAndEnergy);
            shared += u32::from(law.share() > 0.0);
            if (position_m + DVec3::Z * free_length_m).length() < (buckled + 0.03) * free_length_m {
                continue;
            }
            // The servo's rod errs by less than 1e-4 N, a fiftieth of the bound.
            let Some(truth) = exact(&spring, Accuracy::Servo, (position_m, rotation_rad)) else { continue };
            compared += 1;
            let error_n = (answer.force_n - truth.force_n).length();
            worst_n = worst_n.max(error_n);
            worst_nm = worst_nm.max((answer.torque_nm - truth.torque_nm).length());
        }
        let poses: Vec<Pose> = poses.into_iter().map(|(p, r)| Pose::from_rotation_vector(p, r)).collect();
        let mean_ns = mean_ns(&mut law, &poses);
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        println!(
            "{preset:?}: {compared} of {count} poses, error up to {worst_n:.1e} N, {worst_nm:.1e} N m; {shared} with the rod; \
             {mean_ns:.0} ns in the mean, load {}",
            load.split_whitespace().next().unwrap_or("unknown")
        );
        if count == 10_000 {
            let share = f64::from(shared) / f64::from(count) * 100.0;
            let row = format!("| {} | {worst_n:.1e} | {share:.1} % |", in_tables(preset));
            println!("{row}");
            rows.push(row);
        }
        assert!(compared * 3 > count, "{preset:?}: {compared} of {count}");
        assert!(worst_n < TOLERANCE_N, "{preset:?}: {worst_n:e} N");
        let is_short = matches!(preset, Preset::Thesis1 | Preset::Thesis2);
        assert!(!is_short || shared * 10 < count, "{preset:?}: {shared} of {count} with the rod");
    }
    rows.iter().for_each(|row| assert_chapter_prints("models/spring/energy.md", row));
}

/// The tolerance is that of the answer: a smaller one is kept as well, and costs more of the rod.
#[test]
fn a_smaller_tolerance_is_kept_and_needs_the_rod_more_often() {
    let spring = Preset::Thesis1.spring();
    let count = of(1000, 100);
    let shared = [1e-3, 2e-2].map(|tolerance_n| {
        let (mut law, mut shared) = (RodBlend::within(&spring, tolerance_n), 0);
        for (position_m, rotation_rad) in in_the_workspace(&spring, count) {
            law.reset();
            let answer = law.respond(&Pose::from_rotation_vector(position_m, rotation_rad), Demand::Force);
            shared += u32::from(law.share() > 0.0);
            let Some(truth) = exact(&spring, Accuracy::Servo, (position_m, rotation_rad)) else { continue };
            let apart_n = (answer.force_n - truth.force_n).length();
            assert!(apart_n < tolerance_n, "{tolerance_n}: {apart_n:e} N at {position_m} {rotation_rad}");
        }
        shared
    });
    assert!(shared[0] > shared[1], "{shared:?}");
}

/// The share depends on shear, tilt, twist and length; whichever it is that mixes, the wrench is the energy's gradient.
#[test]
fn wrench_is_the_gradient_wherever_the_laws_are_mixed() {
    for (preset, most) in Preset::ALL.into_iter().zip([0.6, 0.6, 0.5, 0.08]) {
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        let (mut law, mut mixed) = (RodBlend::new(&spring), 0);
        for (index, (position_m, rotation_rad)) in reached(&spring, most, 400).into_iter().enumerate() {
            // From a tenth of the turn to half: one of them mixes.
            let pose = Pose::from_rotation_vector(position_m, rotation_rad * (0.1 + 1e-3 * index as f64));
            let here = law.respond(&pose, Demand::WrenchAndEnergy);
            if law.share() < 0.02 || law.share() > 0.98 {
                continue;
            }
            mixed += 1;
            let mut slope = |at: &dyn Fn(f64) -> Pose, h: f64| {
                let mut energy = |s: f64| law.respond(&at(s * h), Demand::WrenchAndEnergy).energy_j.unwrap();
                (8.0 * (energy(1.0) - energy(-1.0)) - energy(2.0) + energy(-2.0)) / (12.0 * h)
            };
            for axis in DVec3::AXES {
                let moved = |s: f64| Pose { position_m: pose.position_m + axis * s, ..pose };
                let turned =
                    |s: f64| Pose { orientation: DQuat::from_axis_angle(axis, s) * pose.orientation, ..pose };
                let force_n = -slope(&moved, 1e-5 * free_length_m);
                let torque_nm = -slope(&turned, 1e-5);
                // Second order in a step of a thousandth of the way through the mix, where that begins, and rounding of 1e-17 J over it.
                assert!((force_n - here.force_n.dot(axis)).abs() < 1e-7, "{preset:?} {pose:?}");
                assert!((torque_nm - here.torque_nm.dot(axis)).abs() < 1e-9, "{preset:?} {pose:?}");
            }
        }
        assert!(mixed > 20, "{preset:?}: {mixed} poses are mixed");
    }
}

/// Spring 3 from rest to past its buckling, sheared and tilted a little.
fn at(compression: f64) -> Pose {
    let free_length_m = Preset::Thesis3.spring().geometry().free_length_m;
    Pose::from_rotation_vector(
        DVec3::new(0.03 * compression, 0.02 * compression, -compression) * free_length_m,
        DVec3::new(0.04, -0.06, 0.05) * compression,
    )
}

fn settled<S: HeldSpring>(law: &mut S, pose: &Pose) -> Response {
    let mut answer = law.respond(pose, Demand::WrenchAndEnergy);
    for _ in 0..200 {
        answer = law.respond(pose, Demand::WrenchAndEnergy);
    }
    answer
}

#[test]
fn the_share_goes_from_one_law_to_the_other() {
    let spring = Preset::Thesis3.spring();
    let (mut law, energy) = (RodBlend::new(&spring), EnergyForm::new(&spring));
    let mut rod = Rod::new(&spring, Accuracy::Servo);
    let (mut last_share, mut shared) = (0.0, 0);
    for step in 0..=1200 {
        let pose = at(f64::from(step) / 2000.0);
        let answer = law.respond(&pose, Demand::WrenchAndEnergy);
        assert!(law.share() >= last_share, "{step}");
        last_share = law.share();
        shared += u32::from(law.share() > 0.0 && law.share() < 1.0);
        let exact = rod.step(&pose, Demand::WrenchAndEnergy);
        if law.share() == 0.0 {
            assert_eq!(
                answer,
                energy.respond(&pose, Demand::WrenchAndEnergy),
                "{step}: nothing else is felt"
            );
            assert!(law.rod_state().is_none());
        }
        if law.share() == 1.0 && exact.validity == Validity::Ok && answer.validity == Validity::Ok {
            // Other stations: a fifth of the bound of the law.
            let apart_n = (answer.force_n - exact.force_n).length();
            assert!(apart_n < 1e-3, "{step}: {apart_n:e} N, {answer:?} {exact:?}");
        }
    }
    assert!(last_share == 1.0 && shared > 50, "{shared} steps blend");
}

#[test]
fn wrench_is_the_gradient_of_the_one_energy() {
    let spring = Preset::Thesis3.spring();
    let h = 1e-6;
    for wanted in [0.2, 0.5, 0.8] {
        let mut law = RodBlend::new(&spring);
        let mut compression = 0.0;
        while law.share() < wanted {
            compression += 1e-3;
            let _ = law.respond(&at(compression), Demand::Force);
        }
        let pose = at(compression);
        let here = settled(&mut law, &pose);
        assert!(law.share() < 0.99, "{compression}: {}", law.share());
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let slope = |at: &dyn Fn(f64) -> Pose| {
                let energy = |s: f64| settled(&mut law.clone(), &at(s * h)).energy_j.unwrap();
                (energy(1.0) - energy(-1.0)) / (2.0 * h)
            };
            let moved = |s: f64| Pose { position_m: pose.position_m + axis * s, ..pose };
            let turned =
                |s: f64| Pose { orientation: DQuat::from_axis_angle(axis, s) * pose.orientation, ..pose };
            // Second order in the step, and 1e-17 J of rounding over it.
            assert!((slope(&moved) + here.force_n.dot(axis)).abs() < 1e-7, "{compression} {axis}");
            assert!((slope(&turned) + here.torque_nm.dot(axis)).abs() < 1e-9, "{compression} {axis}");
        }
    }
}

/// The same where the chord lies down and the rod loses its say by that.
#[test]
fn wrench_is_the_gradient_where_the_chord_lies_down() {
    let spring = Preset::Thesis3.spring();
    let free_length_m = spring.geometry().free_length_m;
    let (h, mut shares) = (1e-6, Vec::new());
    // Chords of 0.4 free lengths, where the rod is alone as long as they stand.
    for degrees in [60.0f64, 68.0, 70.5, 73.0, 80.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let rise = DVec3::new(0.8 * sine, -0.6 * sine, cosine) * (0.4 * free_length_m);
        let pose = Pose::from_rotation_vector(rise - DVec3::Z * free_length_m, DVec3::new(0.03, 0.02, 0.05));
        let mut law = RodBlend::new(&spring);
        let here = settled(&mut law, &pose);
        shares.push(law.share());
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let energy = |n: f64| {
                let position_m = pose.position_m + axis * (n * h);
                settled(&mut law.clone(), &Pose { position_m, ..pose }).energy_j.expect("demanded")
            };
            let pair = |n: f64| energy(n) - energy(-n);
            let slope_n = (8.0 * pair(1.0) - pair(2.0)) / (12.0 * h);
            // Fourth order in a step of a two thousandth of the way from 66 to 78 degrees, and 1e-17 J of rounding over it.
            assert!((slope_n + here.force_n.dot(axis)).abs() < 1e-8, "{degrees} {axis}: {slope_n} {here:?}");
        }
    }
    assert!(shares[0] == 1.0 && shares[4] == 0.0, "{shares:?}");
    assert!(shares.windows(2).all(|pair| pair[1] < pair[0]), "{shares:?}");
}

/// The force, and its slope along the way, change by no more than a smooth function would between two steps.
#[test]
fn nothing_jumps_where_the_laws_meet() {
    let spring = Preset::Thesis3.spring();
    let mut law = RodBlend::new(&spring);
    let forces: Vec<DVec3> = (0..=4000)
        .map(|step| law.respond(&at(0.2 + 0.18 * f64::from(step) / 4000.0), Demand::Force).force_n)
        .collect();
    let steps: Vec<f64> = forces.windows(2).map(|pair| (pair[1] - pair[0]).length()).collect();
    let typical = steps.iter().sum::<f64>() / steps.len() as f64;
    for (index, pair) in steps.windows(2).enumerate() {
        assert!(pair[1] < 3.0 * typical, "{index}: a step of {} N", pair[1]);
        assert!((pair[1] - pair[0]).abs() < 0.05 * typical, "{index}: a kink, {} and {} N", pair[0], pair[1]);
    }
}

/// Poses of which many are blended.
fn scattered(spring: &Spring, compressions: [f64; 2], count: usize) -> Vec<Pose> {
    let mut sampler = Sampler::new(17);
    let free_length_m = spring.geometry().free_length_m;
    let [least, most] = compressions;
    (0..count)
        .map(|_| {
            let down = 0.5 * (least + most) + 0.5 * (most - least) * sampler.signed();
            let aside = sampler.vector([0.15, 0.15, 0.0]);
            let rotation_rad = sampler.vector([0.1, 0.1, 0.1]);
            Pose::from_rotation_vector((aside - DVec3::Z * down) * free_length_m, rotation_rad)
        })
        .collect()
}

/// Asked in any order, held or not, from rest or from elsewhere: the same bits. A spring that cannot buckle is so at every
/// pose, one that can as long as it has not.
#[test]
fn short_of_buckling_the_answer_depends_on_the_pose_alone() {
    // Spring 1 blends where it is bent far and never buckles; spring 3 blends past 26 % as well and buckles past 54 %.
    for (preset, compressions) in [(Preset::Thesis1, [0.5, 0.9]), (Preset::Thesis3, [0.15, 0.45])] {
        let spring = preset.spring();
        let mut wandering = RodBlend::new(&spring);
        let mut blended = 0;
        for pose in scattered(&spring, compressions, 500) {
            let found = wandering.respond(&pose, Demand::WrenchAndEnergy);
            assert_eq!(found.validity, Validity::Ok, "{preset:?} {pose:?}");
            blended += u32::from(wandering.share() > 0.0);
            let first = RodBlend::new(&spring).respond(&pose, Demand::WrenchAndEnergy);
            assert_eq!(found, first, "{preset:?} {pose:?}");
            assert_eq!(wandering.respond(&pose, Demand::WrenchAndEnergy), first, "{preset:?} {pose:?}");
        }
        assert!(blended > 100, "{preset:?}: {blended} of 500");
    }
}

#[test]
fn only_a_spring_that_can_buckle_remembers() {
    let remembers = Preset::ALL.map(|preset| RodBlend::new(&preset.spring()).remembers());
    // Haringx: never below 5.326 diameters.
    assert_eq!(remembers, [false, false, true, true]);
}

/// Most of the way a shape goes in a tick: the root mean square slope of `p = tan(lean / 2)`, rounded up from
/// `LONGEST_WAY` of `src/rod/equilibrium.rs`.
const LONGEST_WAY: f64 = 0.1;

/// The bound holds on the tick on which a branch ends, too: there the shape before is no prediction for the one after.
#[test]
fn the_tick_that_leaves_an_equilibrium_is_bounded_like_the_others() {
    for (preset, compressions) in
        [(Preset::Thesis3, [0.555, 0.60, 0.66]), (Preset::Slender, [0.09, 0.12, 0.2])]
    {
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        let bound_nm = LONGEST_WAY * 2.0 * 2.0f64.sqrt() * spring.rigidities().alpha_n_m2 / free_length_m;
        for compression in compressions {
            let pose = |part: f64, tilt_rad: f64| {
                let position_m = DVec3::new(0.0, 2e-3, -compression) * (part * free_length_m);
                Pose::from_rotation_vector(position_m, DVec3::X * tilt_rad)
            };
            let (mut law, mut most_nm, mut left) = (Rod::new(&spring, Accuracy::Servo), 0.0f64, 0);
            for step in 0..2000 {
                let _ = law.step(&pose(f64::from(step) / 2000.0, 0.1), Demand::Wrench);
            }
            let mut last = law.step(&pose(1.0, 0.1), Demand::Wrench);
            // Through the level at 0.3 rad/s and 1 kHz, there and back.
            for tick in (0..=700).chain((0..700).rev()) {
                let answer = law.step(&pose(1.0, 0.1 - 3e-4 * f64::from(tick)), Demand::Wrench);
                left += u32::from(answer.validity == Validity::NotConverged && last.validity == Validity::Ok);
                most_nm = most_nm.max((answer.torque_nm - last.torque_nm).length());
                last = answer;
            }
            println!("{preset:?} {compression}: {most_nm:.1e} N m of {bound_nm:.1e}, {left} snaps");
            // The bound is of first order in the slope of the bulge; the next order, of a lean of a third of a radian,
            // and the motion of the plate itself add a few percent.
            assert!(most_nm < 1.1 * bound_nm, "{preset:?} {compression}: {most_nm:e} of {bound_nm:e}");
        }
    }
}

/// Rocked through the level, a buckled spring swings its bulge to the other side in its own time, where a law that chose
/// by the pose alone would turn it over at once. The shapes of a bulge are sines, `p = A sin(2 pi S)`; the slope at the
/// plate is then the root of two times its root mean square, and the moment there `2 alpha / L0` times that slope.
#[test]
fn past_buckling_the_bulge_does_not_jump() {
    let spring = Preset::Thesis3.spring();
    let free_length_m = spring.geometry().free_length_m;
    let down = DVec3::NEG_Z * (0.57 * free_length_m);
    let tilted = |part: f64, tilt_rad: f64| Pose::from_rotation_vector(down * part, DVec3::X * tilt_rad);
    let mut law = RodBlend::new(&spring);
    for step in 0..400 {
        let _ = law.respond(&tilted(f64::from(step) / 400.0, 1e-3), Demand::Force);
    }
    let mut last = settled(&mut law, &tilted(1.0, 1e-4));
    let before = last;
    assert!(before.torque_nm.x.abs() > 5e-3, "it has buckled: {before:?}");
    let most_nm = LONGEST_WAY * 2.0 * 2.0f64.sqrt() * spring.rigidities().alpha_n_m2 / free_length_m;
    for _ in 0..400 {
        let answer = law.respond(&tilted(1.0, -1e-4), Demand::Wrench);
        let change_nm = (answer.torque_nm - last.torque_nm).length();
        assert!(change_nm < most_nm, "{change_nm:e} of {most_nm:e}: {last:?} to {answer:?}");
        last = answer;
    }
    assert!(most_nm < 0.1 * before.torque_nm.length(), "or the bound says nothing");
    assert!((last.torque_nm + before.torque_nm).length() < 1e-3 * before.torque_nm.length(), "{last:?}");
}

/// What a search past buckling costs at most that starts from nothing, in evaluations of the energy: two for the bow, five matrices of
/// nine, as many factorings of three and five more where it slides, ten steps in each of three searches and one at their ends.
const MOST_SEARCH: u32 = 2 + 5 * 9 + 10 * 3 + 3 * (10 + 1);

#[test]
fn a_search_past_buckling_is_short() {
    let mut examined = 0;
    for preset in Preset::ALL {
        let spring = preset.spring();
        let mut law = RodBlend::new(&spring);
        if !law.remembers() {
            continue;
        }
        let (mut costs, mut settled) = (Vec::new(), 0);
        for (position_m, rotation_rad) in reached(&spring, 0.6, 2000) {
            law.reset();
            let answer =
                law.respond(&Pose::from_rotation_vector(position_m, rotation_rad), Demand::WrenchAndEnergy);
            // A search without buckling is of another kind and costs less than 25.
            if law.cost() > 25 {
                costs.push(law.cost());
                settled += usize::from(answer.validity == Validity::Ok);
            }
        }
        let most = costs.iter().copied().max().unwrap_or_default();
        let mean = f64::from(costs.iter().sum::<u32>()) / costs.len().max(1) as f64;
        println!("{preset:?}: {} searches, {settled} end, mean cost {mean:.1}, most {most}", costs.len());
        assert!(costs.len() > 100 && 2 * settled >= costs.len(), "{preset:?}: most end in one tick");
        assert!(most <= MOST_SEARCH, "{preset:?}: {most}");
        examined += 1;
    }
    assert!(examined > 0, "some springs buckle");
}
