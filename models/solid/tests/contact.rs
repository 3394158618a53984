//! A sphere that comes and goes: energy of closed paths, steps of the force, poses of every kind.

use flotor_hal::{DQuat, DVec3, Input, Output, Pose, StepStatus, Wrench};
use flotor_loader::{Model, Plugin, Setting};
use flotor_solid::atlas::Atlas;
use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::law::Law;
use flotor_solid::remainder::{Resolution, Size};
use std::sync::OnceLock;

/// A block of 60 x 80 x 50 mm and a sphere of 8 mm, solved once for all tests here.
fn atlas() -> &'static Atlas {
    static SOLVED: OnceLock<Box<Atlas>> = OnceLock::new();
    SOLVED.get_or_init(|| {
        let size = Size { half_x_m: 0.03, half_y_m: 0.04, height_m: 0.05 };
        let description = Description {
            body: Body::Block(size),
            tool: Tool::Sphere { radius_m: 0.008 },
            poisson_ratio: 0.4,
            resolution: Resolution::QUICK,
        };
        match description.solve().expect("a solid").0 {
            Law::Sphere(atlas) => atlas,
            Law::Bonded(_) | Law::Spheres(_) | Law::Anywhere(_) => panic!("a sphere"),
        }
    })
}

/// A generator of numbers from 0 to 1, the same every time (Knuth's multiplier).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    /// A place of the centre in a box around the block, mostly near its surface.
    fn place(&mut self) -> DVec3 {
        DVec3::new(self.between(-0.04, 0.04), self.between(-0.05, 0.05), self.between(-0.045, 0.012))
    }
}

/// One of so many, for a number from 0 to 1.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn pick(share: f64, count: usize) -> usize {
    (share * count as f64) as usize
}

fn force(centre_m: DVec3) -> DVec3 {
    -DVec3::from_array(atlas().answer(centre_m.to_array()).energy.slope)
}

fn energy(centre_m: DVec3) -> f64 {
    atlas().answer(centre_m.to_array()).energy.value
}

/// The force is the gradient of the energy, everywhere: outside, in contact, at edges, deep inside.
#[test]
fn the_force_is_minus_the_slope_of_the_energy() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(1);
    let h = 1.0e-7;
    for _ in 0..2000 {
        let centre = numbers.place();
        let exact = force(centre);
        let difference = -DVec3::from_array(
            DVec3::AXES.map(|axis| (energy(centre + axis * h) - energy(centre - axis * h)) / (2.0 * h)),
        );
        // Second derivatives are at most some modulus times radius over the rounding; on 1e-7 m of it, and roundings of 1e-16 / 1e-7.
        let error = (exact - difference).length();
        assert!(error < 1.0e-4 * exact.length().max(1.0e-6), "{centre} {exact} {difference}");
    }
}

/// Work on the straight step `from` -> `to` by Gauss's rule with three points, J.
fn step_work_j(from: DVec3, to: DVec3) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let at = |x: f64| force(middle + half * x).dot(half);
    let outer = 0.6_f64.sqrt();
    (5.0 * at(-outer) + 8.0 * at(0.0) + 5.0 * at(outer)) / 9.0
}

/// The same, halved where the halves differ from the whole by more than the tolerance: the force has kinks where nodes of its
/// table meet and where contact begins.
fn refined_work_j(from: DVec3, to: DVec3, whole_j: f64, tolerance_j: f64, halvings: u32) -> f64 {
    let middle = 0.5 * (from + to);
    let (first_j, second_j) = (step_work_j(from, middle), step_work_j(middle, to));
    if halvings == 0 || (first_j + second_j - whole_j).abs() < tolerance_j {
        return first_j + second_j;
    }
    let half = |from, to, part_j| refined_work_j(from, to, part_j, 0.5 * tolerance_j, halvings - 1);
    half(from, middle, first_j) + half(middle, to, second_j)
}

/// Work on a closed path between corners, J; also summed without regard to sign.
fn work_j(corners: &[DVec3]) -> (f64, f64) {
    const STEPS: u32 = 200;
    let sides = corners.iter().zip(corners.iter().cycle().skip(1));
    let steps = sides.flat_map(|(from, to)| {
        let at = |k: u32| from.lerp(*to, f64::from(k) / f64::from(STEPS));
        (0..STEPS).map(move |k| (at(k), at(k + 1)))
    });
    let coarse: Vec<_> = steps.map(|(from, to)| (from, to, step_work_j(from, to))).collect();
    let absolute_j: f64 = coarse.iter().map(|(_, _, part_j)| part_j.abs()).sum();
    let tolerance_j = 1.0e-7 * absolute_j / coarse.len() as f64;
    let refined = coarse.iter().map(|&(from, to, part_j)| refined_work_j(from, to, part_j, tolerance_j, 20));
    (refined.sum(), absolute_j)
}

/// A force with a potential makes no energy on any closed path.
#[test]
fn closed_paths_make_no_energy() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(2);
    let (mut made_j, mut all_j) = (0.0, 0.0);
    let paths = crate::cases(60, 10_000);
    for _ in 0..paths {
        let corners: Vec<DVec3> = (0..4).map(|_| numbers.place()).collect();
        let (work, absolute_j) = work_j(&corners);
        made_j += work.abs();
        all_j += absolute_j;
    }
    println!("{paths} closed paths: {:e} of the absolute work", made_j / all_j);
    assert!(made_j < 1.0e-6 * all_j, "{made_j:e} of {all_j:e}");
}

/// Along random straight ways the force never jumps: a step of 10 um changes it by no more than 1.5 times what steps ten times
/// smaller on both sides promise.
#[test]
fn the_force_does_not_jump() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(3);
    let step_m = 1.0e-5;
    let mut largest: f64 = 0.0;
    for _ in 0..crate::cases(20_000, 1_000_000) {
        let from = numbers.place();
        let way =
            DVec3::new(numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0));
        let to = from + way.normalize() * step_m;
        let change = (force(to) - force(from)).length();
        let bound = 1.5 * largest_stiffness([from, to], 0.1 * step_m, force) * step_m;
        largest = largest.max(change / (bound / 1.5).max(1.0e-12));
        assert!(change <= bound.max(1.0e-12), "{from} {to}: {change} {bound}");
    }
    println!("largest step: {largest:.3} of stiffness times travel");
}

/// Returns the larger stiffness of two places, N/m, from forces at small distances from them.
pub(crate) fn largest_stiffness(places: [DVec3; 2], small_m: f64, force: impl Fn(DVec3) -> DVec3) -> f64 {
    let stiffness = places.map(|at| {
        let columns = DVec3::AXES
            .map(|axis| (force(at + axis * small_m) - force(at - axis * small_m)) / (2.0 * small_m));
        // The norm of Frobenius is at least the largest singular value and at most root three times it.
        columns.iter().map(|c| c.length_squared()).sum::<f64>().sqrt()
    });
    stiffness[0].max(stiffness[1])
}

/// Checks that the plugin refuses each of these settings for the reason beside it.
pub(crate) fn assert_refused(cases: &[(&[(&str, &str)], &str)]) {
    let plugin = Plugin::in_process(&flotor_solid::FLOTOR_ENTRY).expect("the solid is a plugin");
    for (settings, wanted) in cases {
        let error =
            plugin.create_model(&parsed(&plugin, settings)).map(|_| ()).expect_err(wanted).to_string();
        assert!(error.contains(wanted), "{wanted}: {error}");
    }
}

fn parsed(plugin: &Plugin, settings: &[(&str, &str)]) -> Vec<Setting> {
    let parsed =
        |(id, value): &(&str, &str)| Setting::parse(plugin.parameters(), id, value).expect("a setting");
    settings.iter().map(parsed).collect()
}

pub(crate) fn model(settings: &[(&str, &str)]) -> Model {
    let plugin = Plugin::in_process(&flotor_solid::FLOTOR_ENTRY).expect("the solid is a plugin");
    plugin.create_model(&parsed(&plugin, settings)).expect("a solid")
}

pub(crate) fn step(model: &mut Model, pose: Pose) -> Output {
    let mut output = Output::from(Wrench::ZERO);
    let _ = model.step(&Input::at_rest(pose), &mut output);
    output
}

const HALF_SPACE: &[(&str, &str)] = &[("body", "half-space"), ("tool_radius_mm", "8")];

#[test]
fn any_pose_has_a_finite_answer_and_a_status() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(4);
    let mut models = [
        model(HALF_SPACE),
        model(&[("body", "half-space"), ("tool", "punch-square"), ("tool_side_mm", "20")]),
    ];
    let odd = [0.0, -0.0, 1.0e-300, 1.0, -1.0e3, 1.0e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for i in 0..crate::cases(100_000, 1_000_000) {
        let mut coordinate = || {
            let kind = numbers.next();
            if kind < 0.1 { odd[pick(numbers.next(), odd.len())] } else { numbers.between(-0.05, 0.05) }
        };
        let position = DVec3::new(coordinate(), coordinate(), coordinate());
        let pose = Pose::new(position, DQuat::from_rotation_x(coordinate().clamp(-3.0, 3.0)));
        let output = step(&mut models[i % 2], pose);
        assert!(output.wrench.is_finite(), "{pose:?}");
        let status = output.status().expect("a known status");
        assert_eq!(status == StepStatus::InvalidInput, !pose.is_finite(), "{pose:?} {status:?}");
        if i % 2 == 0 && pose.is_finite() {
            let deep = -position.z > 1.2 * 0.008;
            assert_eq!(
                status == StepStatus::Clamped,
                deep || position.abs().max_element() > 10.0,
                "{pose:?}"
            );
        }
    }
    // Around the block's table too, which has edges, corners and a middle.
    for _ in 0..crate::cases(20_000, 1_000_000) {
        let centre = numbers.place();
        assert!(force(centre).is_finite());
    }
    for x in [-0.03, 0.0, 0.03, 0.0284, 1.0] {
        for z in [-0.05, -0.025, 0.0, -0.001, 5.0] {
            assert!(force(DVec3::new(x, 0.04, z)).is_finite());
        }
    }
}

/// A rotation is a quaternion of length one: anything else is no pose, however finite.
#[test]
fn an_orientation_that_is_none_is_invalid_input() {
    let mut punch = model(&[("body", "half-space"), ("tool", "punch-square"), ("tool_side_mm", "20")]);
    for orientation_xyzw in [[0.0; 4], [1.0e199; 4], [0.0, 0.0, 0.0, 1.0e308], [0.0, 0.0, 0.0, 1.01]] {
        let output = step(&mut punch, Pose { position_m: [1.0e-3; 3], orientation_xyzw });
        assert_eq!(output.status(), Some(StepStatus::InvalidInput), "{orientation_xyzw:?}");
        assert_eq!(output.wrench, Wrench::ZERO);
    }
}

/// With friction a closed path costs energy, or nothing where nothing slips.
#[test]
fn friction_only_takes_energy() {
    let mut rough = model(&[("body", "half-space"), ("tool_radius_mm", "8"), ("friction", "0.5")]);
    let mut numbers = Numbers(5);
    let mut most = f64::NEG_INFINITY;
    for _ in 0..crate::cases(50, 10_000) {
        let _ = rough.reset();
        let corners: Vec<DVec3> = (0..4)
            .map(|k| {
                let z = if k == 0 { 0.001 } else { numbers.between(-0.004, 0.0005) };
                DVec3::new(numbers.between(-0.005, 0.005), numbers.between(-0.005, 0.005), z)
            })
            .collect();
        let (mut work_j, mut absolute_j) = (0.0, 0.0);
        let mut before = step(&mut rough, Pose::new(corners[0], DQuat::IDENTITY)).wrench.force();
        for (i, from) in corners.iter().enumerate() {
            let to = corners[(i + 1) % corners.len()];
            let steps = 20_000;
            for k in 1..=steps {
                let at = from.lerp(to, f64::from(k) / f64::from(steps));
                let now = step(&mut rough, Pose::new(at, DQuat::IDENTITY)).wrench.force();
                let part = 0.5 * (before + now).dot((to - *from) / f64::from(steps));
                work_j += part;
                absolute_j += part.abs();
                before = now;
            }
        }
        // The trapezoidal rule on steps of half a micrometre: second order, a millionth.
        assert!(work_j <= 1.0e-6 * absolute_j, "{work_j} of {absolute_j}");
        most = most.max(work_j / absolute_j);
    }
    println!("most work of a closed path with friction: {most:e} of its absolute work");
}
