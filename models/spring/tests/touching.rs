//! Coils that touch, tick by tick: no step of the force that stiffness and travel do not explain, no tick without an
//! equilibrium on a smooth path, and the same answer at a pose wherever the hand came from.

use crate::sample::{Sampler, of};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Coils, Rod};
use flotor_spring::validity::Validity;

/// Lever arm at which a turn is as long as a shift, m.
const LEVER_M: f64 = 0.05;
/// Travel of a tick, m.
const TICK_M: f64 = 1e-6;
/// Ticks of a line.
const TICKS: u32 = 300;

type Six = [f64; 6];

/// Force and torque at the lever arm.
fn felt(answer: &Response) -> Six {
    let ([x, y, z], [a, b, c]) = (answer.force_n.to_array(), (answer.torque_nm / LEVER_M).to_array());
    [x, y, z, a, b, c]
}

fn apart(one: &Six, other: &Six) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn moved(pose: &Pose, along: &Six, way_m: f64) -> Pose {
    let [x, y, z, a, b, c] = along.map(|part| part * way_m);
    let turn = DQuat::from_scaled_axis(DVec3::new(a, b, c) / LEVER_M);
    Pose { position_m: pose.position_m + DVec3::new(x, y, z), orientation: turn * pose.orientation }
}

/// Largest gain of the tangent, from one-sided steps ten times smaller than a tick, the larger of both sides.
fn stiffness(rod: &Rod, pose: &Pose) -> f64 {
    let step_m = 0.1 * TICK_M;
    let ask = |way_m: f64, axis: usize| {
        let mut along = [0.0; 6];
        along[axis] = 1.0;
        felt(&rod.clone().step(&moved(pose, &along, way_m), Demand::Wrench))
    };
    let here = ask(0.0, 0);
    let gain = |sign: f64| {
        let columns: [Six; 6] = std::array::from_fn(|axis| {
            let there = ask(sign * step_m, axis);
            std::array::from_fn(|i| (there[i] - here[i]) / step_m)
        });
        largest_singular_value(&columns)
    };
    gain(1.0).max(gain(-1.0))
}

/// By the power method on the product with the transpose, from a direction that no axis is across to.
fn largest_singular_value(columns: &[Six; 6]) -> f64 {
    let mut along: Six = [0.41, -0.37, 0.53, 0.29, 0.47, -0.31];
    let mut size = 0.0;
    for _ in 0..60 {
        let image: Six = std::array::from_fn(|i| (0..6).map(|j| columns[j][i] * along[j]).sum());
        let back: Six = std::array::from_fn(|j| (0..6).map(|i| columns[j][i] * image[i]).sum());
        size = apart(&image, &[0.0; 6]) / apart(&along, &[0.0; 6]);
        let length = apart(&back, &[0.0; 6]);
        if length == 0.0 {
            return 0.0;
        }
        along = back.map(|part| part / length);
    }
    size
}

/// A place where coils touch or are about to, and a direction.
fn near_solid(spring: &Spring, sampler: &mut Sampler) -> (Pose, Six) {
    let geometry = spring.geometry();
    let solid = 1.0 - geometry.solid_length_m() / geometry.free_length_m;
    let depth = solid - 0.01 + 0.02 * sampler.signed();
    let aside = sampler.vector([0.06, 0.06, 0.0]);
    let pose = Pose::from_rotation_vector(
        (aside - DVec3::Z * depth) * geometry.free_length_m,
        sampler.vector([0.05, 0.05, 0.05]),
    );
    let along: Six = std::array::from_fn(|_| sampler.signed());
    let length = apart(&along, &[0.0; 6]);
    (pose, along.map(|part| part / length))
}

/// Walked there from rest and held until it has converged.
fn walked(spring: &Spring, goal: &Pose) -> (Rod, Response) {
    let mut rod = Rod::to_rounding(spring, Coils::Touch);
    for step in 1..=400 {
        let part = f64::from(step) / 400.0;
        let orientation = DQuat::IDENTITY.slerp(goal.orientation, part);
        let _ = rod.step(&Pose { position_m: goal.position_m * part, orientation }, Demand::Wrench);
    }
    let answer = held(&mut rod, goal);
    (rod, answer)
}

fn held(rod: &mut Rod, pose: &Pose) -> Response {
    let mut answer = rod.step(pose, Demand::WrenchAndEnergy);
    for _ in 0..2000 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = rod.step(pose, Demand::WrenchAndEnergy);
    }
    answer
}

#[test]
fn no_step_is_larger_than_stiffness_and_travel_explain() {
    for preset in [Preset::Thesis1, Preset::Thesis2] {
        let (spring, mut sampler) = (preset.spring(), Sampler::new(71));
        let (mut most, mut waited, mut touched) = (0.0f64, 0, 0);
        for _ in 0..of(150, 8) {
            let (start, along) = near_solid(&spring, &mut sampler);
            let (mut rod, first) = walked(&spring, &start);
            let mut last = felt(&first);
            // The tick with the largest step, and the worst of every thirtieth.
            let mut looked: Vec<(f64, Rod, Pose)> = Vec::new();
            for tick in 1..=TICKS {
                let pose = moved(&start, &along, TICK_M * f64::from(tick));
                let before = rod.clone();
                let answer = rod.step(&pose, Demand::Wrench);
                waited += u32::from(answer.validity == Validity::NotConverged);
                let here = felt(&answer);
                let step_n = apart(&here, &last);
                if tick % 30 == 1 {
                    looked.push((step_n, before, pose));
                } else if looked.last().is_some_and(|(most_n, ..)| step_n > *most_n) {
                    looked.pop();
                    looked.push((step_n, before, pose));
                }
                last = here;
            }
            for (step_n, before, pose) in looked {
                let from = moved(&pose, &along, -TICK_M);
                let stiffness_n_per_m =
                    stiffness(&rod_at(&before, &pose), &pose).max(stiffness(&before, &from));
                touched += u32::from(stiffness_n_per_m > 5e3);
                most = most.max(step_n / (stiffness_n_per_m * TICK_M));
            }
        }
        println!(
            "{preset:?}: steps up to {most:.3} of stiffness and travel, {waited} ticks wait, {touched} touch"
        );
        assert!(most < 1.5, "{preset:?}: {most}");
        assert_eq!(waited, 0, "{preset:?}");
        assert!(touched > 20, "{preset:?}: {touched} places are of touching coils");
    }
}

fn rod_at(before: &Rod, pose: &Pose) -> Rod {
    let mut rod = before.clone();
    let _ = rod.step(pose, Demand::Wrench);
    rod
}

#[test]
fn a_pose_has_one_answer_wherever_the_hand_came_from() {
    for preset in [Preset::Thesis1, Preset::Thesis2] {
        let (spring, mut sampler) = (preset.spring(), Sampler::new(72));
        let mut apart_n = 0.0f64;
        for _ in 0..of(150, 12) {
            let (start, along) = near_solid(&spring, &mut sampler);
            let (mut rod, _) = walked(&spring, &start);
            for tick in 1..=TICKS {
                let pose = moved(&start, &along, TICK_M * f64::from(tick));
                let here = rod.step(&pose, Demand::WrenchAndEnergy);
                if tick % 60 == 0 {
                    let cold = held(&mut Rod::to_rounding(&spring, Coils::Touch), &pose);
                    apart_n = apart_n.max((here.force_n - cold.force_n).length());
                }
            }
        }
        println!("{preset:?}: cold and walked are up to {apart_n:.1e} N apart");
        // What a search to rounding leaves, on 25 N/mm and tens of newtons.
        assert!(apart_n < 1e-8, "{preset:?}: {apart_n:e} N");
    }
}
