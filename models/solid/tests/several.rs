//! Several spheres on one handle: beside contacts that are solved together, and the laws of one.

use crate::contact::{Numbers, assert_refused, largest_stiffness, model, step};
use flotor_hal::{DQuat, DVec3, Pose, StepStatus};
use flotor_solid::dense;
use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::half_space::HalfSpace;
use flotor_solid::law::Law;
use flotor_solid::remainder::{Face, Remainder, Resolution, Size};
use flotor_solid::several::Spheres;
use flotor_solid::table::Table;
use std::sync::OnceLock;

const RADIUS_M: f64 = 0.008;
const NU: f64 = 0.3;
const SOLID: HalfSpace = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: NU };
const CUBE: Size = Size { half_x_m: 0.04, half_y_m: 0.04, height_m: 0.08 };

fn spheres(body: Body, count: usize, spacing_m: f64) -> Spheres {
    let solve = || {
        let tool = Tool::Spheres { radius_m: RADIUS_M, count, spacing_m };
        let description = Description { body, tool, poisson_ratio: NU, resolution: Resolution::QUICK };
        let Law::Spheres(spheres) = description.solve().expect("a solid").0 else { panic!("spheres") };
        *spheres
    };
    // A block takes a second to solve, whatever the number and distance of the spheres; a half-space is solved each time.
    static ON_CUBE: OnceLock<Spheres> = OnceLock::new();
    if body != Body::Block(CUBE) {
        return solve();
    }
    let Spheres { atlas, beyond, .. } = ON_CUBE.get_or_init(solve).clone();
    Spheres::new(atlas, NU, count, spacing_m, beyond)
}

/// Vertical forces, N, of spheres with their centres at these places and the face this deep inside, all contacts solved
/// together: pressures without friction on cells of a disc about each, normals upright.
fn together_n(centres_m: &[[f64; 2]], depths_m: &[f64], table: Option<&Table>) -> Vec<f64> {
    const RINGS: i32 = 7;
    let largest_m = depths_m.iter().copied().fold(0.0, f64::max);
    let cell_m = 1.15 * (RADIUS_M * largest_m).sqrt() / f64::from(RINGS);
    let (mut points, mut below_m, mut owner) = (Vec::new(), Vec::new(), Vec::new());
    for (sphere, (centre, depth_m)) in centres_m.iter().zip(depths_m).enumerate() {
        for (i, j) in (-RINGS..=RINGS).flat_map(|i| (-RINGS..=RINGS).map(move |j| (i, j))) {
            if i * i + j * j > RINGS * RINGS {
                continue;
            }
            let beside = [f64::from(i) * cell_m, f64::from(j) * cell_m];
            let square = beside[0] * beside[0] + beside[1] * beside[1];
            points.push([centre[0] + beside[0], centre[1] + beside[1]]);
            below_m.push(depth_m - RADIUS_M + (RADIUS_M * RADIUS_M - square).sqrt());
            owner.push(sphere);
        }
    }
    let count = points.len();
    let smooth = table.map(|table| table.among(&points));
    let half = 0.5 * cell_m;
    let compliance: Vec<f64> = (0..count * count)
        .map(|pair| {
            let (target, source) = (points[pair / count], points[pair % count]);
            let corner = |x: f64, y: f64| [source[0] - target[0] + x, source[1] - target[1] + y];
            let corners =
                [corner(-half, -half), corner(half, -half), corner(half, half), corner(-half, half)];
            let more = smooth.as_ref().map_or(0.0, |smooth| smooth[pair][2][2]);
            SOLID.polygon(&corners)[2][2] / (cell_m * cell_m) + more
        })
        .collect();
    let mut active: Vec<bool> = below_m.iter().map(|below| *below > 0.0).collect();
    loop {
        let cells: Vec<usize> = (0..count).filter(|&cell| active[cell]).collect();
        let size = cells.len();
        let mut matrix = vec![0.0; size * size];
        for (column, source) in cells.iter().enumerate() {
            for (row, target) in cells.iter().enumerate() {
                matrix[column * size + row] = compliance[target * count + source];
            }
        }
        let mut forces: Vec<f64> = cells.iter().map(|&cell| below_m[cell]).collect();
        dense::factor(&mut matrix, size, size).expect("a compliance");
        dense::solve(&matrix, size, &mut forces);
        let mut changed = false;
        for (&cell, &force) in cells.iter().zip(&forces) {
            if force < 0.0 {
                (active[cell], changed) = (false, true);
            }
        }
        if !changed {
            let mut sums = vec![0.0; centres_m.len()];
            cells.iter().zip(&forces).for_each(|(&cell, force)| sums[owner[cell]] += force);
            return sums;
        }
    }
}

/// How much less two or four spheres need than as many far from each other.
#[test]
fn contacts_push_the_surface_down_under_each_other() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let remainder = Remainder::new(CUBE, SOLID, Resolution::STANDARD.fineness()).expect("a solid");
    let nodes = [0.0, 0.008, 0.016, 0.024, 0.032];
    let table = Table::new(&remainder, Face::Top, [&nodes, &nodes]);
    for (body, table) in [(Body::HalfSpace, None), (Body::Block(CUBE), Some(&table))] {
        // The solved ones take a second each; in every change's checks the nearest pair and the farthest four.
        let tools = [(2, 0.017), (4, 0.030), (2, 0.030), (3, 0.020), (4, 0.018)];
        for &(count, spacing_m) in &tools[..crate::cases(2, tools.len())] {
            let law = spheres(body, count, spacing_m);
            for &depth_m in &[0.001, 0.0003][..crate::cases(1, 2)] {
                let answer = law.answer(DVec3::Z * -depth_m, DQuat::IDENTITY);
                let centres: Vec<[f64; 2]> =
                    answer.centres_m[..count].iter().map(|centre| [centre.x, centre.y]).collect();
                let alone: f64 = centres
                    .iter()
                    .map(|at| -law.atlas.answer([at[0], at[1], RADIUS_M - depth_m]).energy.slope[2])
                    .sum();
                let exact_alone: f64 =
                    centres.iter().map(|at| together_n(&[*at], &[depth_m], table)[0]).sum();
                let exact: f64 = together_n(&centres, &vec![depth_m; count], table).iter().sum();
                let (share, exact_share) = (answer.wrench.force().z / alone, exact / exact_alone);
                println!(
                    "{count} spheres, {spacing_m} m, {depth_m} m deep: {share:.4}, solved {exact_share:.4}"
                );
                assert!(exact_share < 0.985, "{exact_share}");
                // The solved normals are upright and the law's are not: up to 2 % of a force at these depths, twice in their product;
                // the law's contacts are points to each other: another half percent.
                let bound = 0.05 * (1.0 - exact_share);
                assert!((share - exact_share).abs() < bound, "{count} {spacing_m}: {share} {exact_share}");
            }
        }
    }
}

/// Tilted, one sphere is deeper than the other: each of their forces, and so the torque.
#[test]
fn a_tilted_tool_feels_a_torque() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let law = spheres(Body::HalfSpace, 2, 0.020);
    for (angle, position) in [(0.03, -0.0006), (0.06, 0.0), (0.08, -0.0012), (0.2, 0.0005)] {
        let answer = law.answer(DVec3::Z * position, DQuat::from_rotation_y(angle));
        let centres: Vec<[f64; 2]> = answer.centres_m[..2].iter().map(|c| [c.x, c.y]).collect();
        let depths: Vec<f64> = answer.centres_m[..2].iter().map(|c| RADIUS_M - c.z).collect();
        let deep: Vec<usize> = (0..2).filter(|&i| depths[i] > 0.0).collect();
        let pick = |i: usize| (centres[i], depths[i]);
        let (at, inside): (Vec<_>, Vec<_>) = deep.iter().map(|&i| pick(i)).unzip();
        let exact = together_n(&at, &inside, None);
        for (force, &i) in exact.iter().zip(&deep) {
            let own = answer.forces_n[i].z;
            println!("{angle} {position}: {own:.3e} solved {force:.3e}");
            // The solved normals are upright: two percent of a force at these depths, twice that where one is shallow.
            assert!((own / force - 1.0).abs() < 0.05, "{angle} {position}: {own} {force}");
        }
    }
}

/// The wrench is the gradient of the energy, over position and rotation, and a solve always ends.
#[test]
fn the_wrench_of_several_spheres_is_minus_the_slope_of_their_energy() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(11);
    let mut contacts = [0; 5];
    for (body, count, spacing_m) in [
        (Body::HalfSpace, 2, 0.0161),
        (Body::HalfSpace, 4, 0.016),
        (Body::Block(CUBE), 3, 0.03),
        (Body::Block(CUBE), 4, 0.02),
    ] {
        let law = spheres(body, count, spacing_m);
        let middle = |up_m: f64| law.atlas.answer([0.0, 0.0, up_m]).energy.slope[2];
        let strongest = 1.6 * middle(-0.5 * RADIUS_M).abs();
        for _ in 0..crate::cases(500, 100_000) {
            let position = DVec3::new(
                numbers.between(-0.03, 0.03),
                numbers.between(-0.03, 0.03),
                // Half of them deeper than is answered, down to three radii.
                numbers.between(0.0, 1.0) * numbers.between(0.0, 1.0) * -0.028 + 0.004,
            );
            let mut angle = || numbers.between(-0.3, 0.3);
            let turn = DQuat::from_scaled_axis(DVec3::new(angle(), angle(), 3.0 * angle()));
            let answer = law.answer(position, turn);
            assert!(answer.is_settled, "{position} {turn}");
            // Behind the deepest that is answered, a force is constant but for what the place makes of it.
            let most = strongest * count as f64;
            assert!(answer.wrench.force().length() < most, "{position} {turn} {answer:?}");
            let touching = answer.depths_m[..count].iter().filter(|depth| **depth > 0.0).count();
            contacts[touching] += 1;
            let h = 1.0e-7;
            let size = answer.wrench.force().length().max(1.0e-6);
            for axis in DVec3::AXES {
                let moved = |s: f64| law.answer(position + axis * s, turn).energy_j;
                let turned = |s: f64| law.answer(position, DQuat::from_scaled_axis(axis * s) * turn).energy_j;
                let force = (moved(h) - moved(-h)) / (2.0 * h);
                let torque = (turned(50.0 * h) - turned(-50.0 * h)) / (100.0 * h);
                // As for one sphere; a radian moves a centre by hundredths of a metre.
                assert!(
                    (answer.wrench.force().dot(axis) + force).abs() < 1.0e-4 * size,
                    "{position} {axis} {answer:?} {force}"
                );
                assert!(
                    (answer.wrench.torque().dot(axis) + torque).abs() < 1.0e-5 * size,
                    "{position} {axis} {} {torque}",
                    answer.wrench.torque().dot(axis)
                );
            }
        }
    }
    println!("poses by the number of contacts: {contacts:?}");
    assert!(contacts.iter().all(|count| *count > 10), "{contacts:?}");
}

/// Steps of the force and the torque are no larger than steps ten times smaller on both sides promise, as contacts come and go.
#[test]
fn several_spheres_do_not_jump() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let mut numbers = Numbers(12);
    let law = spheres(Body::Block(CUBE), 4, 0.02);
    let step_m = 1.0e-5;
    for _ in 0..crate::cases(5_000, 1_000_000) {
        let from = DVec3::new(
            numbers.between(-0.04, 0.04),
            numbers.between(-0.04, 0.04),
            numbers.between(0.0, 1.0) * numbers.between(0.0, 1.0) * -0.026 + 0.002,
        );
        let turn =
            DQuat::from_scaled_axis(DVec3::new(numbers.between(-0.2, 0.2), numbers.between(-0.2, 0.2), 0.3));
        let way =
            DVec3::new(numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0), numbers.between(-1.0, 1.0));
        let to = from + way.normalize() * step_m;
        let force = |at: DVec3| law.answer(at, turn).wrench.force();
        let change = (force(to) - force(from)).length();
        let bound = 1.5 * largest_stiffness([from, to], 0.1 * step_m, force) * step_m;
        assert!(change <= bound.max(1.0e-12), "{from} {to}: {change} {bound}");
    }
}

const TWO: &[(&str, &str)] =
    &[("body", "half-space"), ("tool_radius_mm", "8"), ("tool_count", "2"), ("tool_spacing_mm", "20")];

/// Through the plugin: any pose has a finite answer and a status, and details count the contacts.
#[test]
fn any_pose_of_several_spheres_has_a_finite_answer() {
    let mut two = model(TWO);
    let mut numbers = Numbers(13);
    let odd = [0.0, -0.0, 1.0e-300, 1.0, -1.0e3, 1.0e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    for _ in 0..crate::cases(5_000, 1_000_000) {
        let mut coordinate = || match numbers.between(0.0, 90.0) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below nine
            x if x < 9.0 => odd[x as usize],
            x => (x - 50.0) * 1.0e-3,
        };
        let position = DVec3::new(coordinate(), coordinate(), coordinate());
        let pose = Pose::new(position, DQuat::from_rotation_x((60.0 * coordinate()).clamp(-3.0, 3.0)));
        let output = step(&mut two, pose);
        assert!(output.wrench.is_finite(), "{pose:?}");
        let status = output.status().expect("a known status");
        assert_eq!(status == StepStatus::InvalidInput, !pose.is_finite(), "{pose:?} {status:?}");
    }
    let mut values = [0.0; 3];
    for (tilt, wanted) in [(0.0, 2.0), (0.2, 1.0)] {
        step(&mut two, Pose::new(DVec3::Z * -0.001, DQuat::from_rotation_y(tilt)));
        two.read_details(&mut values);
        assert_eq!(values[1], wanted, "{values:?}");
    }
}

/// Settings that do not go together are refused with the parameter.
#[test]
fn settings_of_several_spheres_that_do_not_fit_are_refused() {
    assert_refused(&[
        (&[("tool_count", "2"), ("tool_spacing_mm", "20")], "at least 25.4"),
        (
            &[("tool_count", "2"), ("tool_radius_mm", "5"), ("tool_spacing_mm", "90")],
            "at most 66.6666 mm for this face",
        ),
        (&[("tool_count", "3"), ("body", "cylinder")], "block or a half-space"),
        (&[("tool_count", "3"), ("tool", "punch-round")], "tool_count"),
        (&[("tool_count", "3"), ("bond", "bonded")], "not bonded"),
    ]);
}
