//! Edges, seams and sheets: places at which a ball was once held on the wrong face, or not at rest.

use crate::contact::{Hand, material};
use crate::shapes::{cuboid, sheet, soup_of_both, surface};
use flotor_hal::DVec3;

/// Boxes on both sides of x = 0, with a common face of other triangles on each side.
fn two_boxes() -> flotor_surface::surface::Surface {
    let half = DVec3::splat(0.01);
    surface(soup_of_both(cuboid(-half, half.with_x(0.0), 2), cuboid(-half.with_x(0.0), half, 3)), 30.0)
}

#[test]
fn a_point_on_a_curved_sheet_keeps_its_side() {
    let saddle = surface(sheet(20, |x, y| (x * x - y * y) / 0.03), 30.0);
    let mut hand = Hand::new(&saddle, material(0.0, 0.0), 0.0, DVec3::new(-0.00275, -0.00223, 0.00167));
    let tool_m = DVec3::new(-0.004, -0.00321, -0.000158);
    let answer = hand.slowly_to(tool_m);
    let nearest = |p: &flotor_surface::patch::Patch| p.nearest(tool_m).distance_m;
    let least_m = saddle.patches().iter().map(nearest).fold(f64::INFINITY, f64::min);
    assert!(answer.is_settled && (answer.depth_m - least_m).abs() < 1.0e-9, "{answer:?} {least_m}");
    assert!(answer.force_n.z > 0.0);
}

#[test]
fn a_ball_slides_over_the_seam_of_two_bodies() {
    let boxes = two_boxes();
    for radius_m in [0.0, 2.0e-5, 1.0e-3] {
        let mut hand = Hand::new(&boxes, material(0.0, 0.0), radius_m, DVec3::new(-0.002, -0.0117, 0.0019));
        for x_m in [-0.001, -1.0e-5, 1.0e-7, 8.0e-5, 2.0e-3, -3.0e-7, -0.001] {
            let answer = hand.slowly_to(DVec3::new(x_m, -0.0098, 0.0008));
            let expected_n = DVec3::NEG_Y * (0.2 + 1.0e3 * radius_m);
            assert!((answer.force_n - expected_n).length() < 1.0e-9, "{radius_m} {x_m}: {answer:?}");
            assert!(answer.is_settled, "{radius_m} {x_m}: {answer:?}");
        }
    }
}

#[test]
fn a_tool_between_bodies_that_touch_is_inside() {
    let boxes = two_boxes();
    for x_m in [-0.002, -1.0e-4, 1.0e-4, 0.003] {
        let mut hand = Hand::new(&boxes, material(0.0, 0.0), 2.0e-5, DVec3::new(x_m, 0.001, 0.002));
        let answer = hand.slowly_to(DVec3::new(0.5 * x_m, 0.0015, 0.0025));
        assert!(answer.is_overlapping, "{x_m}: {answer:?}");
    }
}

#[test]
fn the_face_that_the_tool_enters_beside_an_edge_holds_the_ball() {
    let half = DVec3::new(0.01, 0.01, 1.0e-4);
    let plate = surface(cuboid(-half, half, 4), 30.0);
    let radius_m = 2.0e-5;
    // The way runs 4.6 um above the rim: in through the top, however long a step is.
    let start_m = DVec3::new(0.009957, 0.01215, 3.9657e-4);
    let end_m = DVec3::new(0.009935, 0.0098081, 7.854e-5);
    for steps in [3, 50, 1000] {
        let mut hand = Hand::new(&plate, material(0.0, 0.0), radius_m, start_m);
        let answers = (1..=steps).map(|i| hand.to(start_m.lerp(end_m, f64::from(i) / f64::from(steps))));
        let answer = answers.last().expect("a step");
        let expected_n = DVec3::Z * (1.0e-4 + radius_m - end_m.z) * 1.0e3;
        assert!((answer.force_n - expected_n).length() < 1.0e-9, "{steps}: {answer:?}");
    }
}
