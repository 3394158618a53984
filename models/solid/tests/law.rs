//! The law of a ball anywhere on a mesh, against contacts solved anew on finer meshes, at places it has not seen.

use crate::anywhere::{body, mesh};
use crate::contact::Numbers;
use flotor_hal::DVec3;
use flotor_solid::condensation::Condensation;
use flotor_solid::refinement::Grading;
use flotor_solid::survey::survey;
use flotor_solid::touch::{Touch, Zone};

const RADIUS_M: f64 = 0.005;

/// The force of one contact, its mesh refined to a third of the contact's radius.
fn solve(body: &Condensation, centre_m: [f64; 3], away: DVec3, depth_m: f64) -> DVec3 {
    let place = DVec3::from_array(centre_m) - away * (RADIUS_M - depth_m);
    let least_m = 0.35 * (RADIUS_M * depth_m).sqrt();
    let grading = Grading { points_m: vec![place.to_array()], least_m, grade: 0.6 };
    let zone = Zone::new(body, &grading, &[centre_m], RADIUS_M).expect("positive definite");
    let touch = zone.solve(centre_m, RADIUS_M, &Touch::default()).expect("a contact");
    DVec3::from_array(touch.force_n)
}

/// Where the law has a domain it must hold, and say how well.
#[test]
fn where_the_law_of_a_dome_holds_its_error_is_below_its_bound_at_unseen_places() {
    if std::env::var("FLOTOR_TEST_SIZE").as_deref() != Ok("full") {
        println!("skipped: takes ten minutes of a processor");
        return;
    }
    let (mesh, body) = (mesh("dome"), body("dome", 0.3, 1.0));
    let hertz = 8.0 / 15.0 / (1.0 - 0.3 * 0.3) * RADIUS_M.sqrt();
    let law = survey(&mesh, &body, RADIUS_M, hertz, (192, 0.7)).expect("a law");
    let mut numbers = Numbers(7);
    let (mut tried, mut held, mut sure) = (0, 0, 0);
    while held < 20 && tried < 1_000_000 {
        tried += 1;
        let lattice = &law.lattice;
        let along = |k: usize| lattice.low_m[k] + lattice.step_m * lattice.counts[k] as f64;
        let centre_m = [0, 1, 2].map(|k| numbers.between(lattice.low_m[k], along(k)));
        let answer = law.answer(centre_m);
        if answer.depth_m < 0.1 * RADIUS_M || !answer.is_in_domain(RADIUS_M) {
            continue;
        }
        held += 1;
        let force = -DVec3::from_array(answer.energy.slope);
        let exact = solve(&body, centre_m, force.normalize(), answer.depth_m);
        let error = (force - exact).length() / exact.length();
        println!("depth {:.2} mm error {error:.4} estimate {:.4}", answer.depth_m * 1.0e3, answer.error);
        assert!(error < 0.04, "{centre_m:?}: {error}");
        sure += usize::from(error <= answer.error);
    }
    assert_eq!(held, 20, "the law holds nowhere");
    assert!(sure >= 19, "{sure} of 20");
}
