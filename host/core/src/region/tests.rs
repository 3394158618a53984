use super::*;

const FORCE: DVec3 = DVec3::new(30.0, -40.0, 1.0);

#[test]
fn a_ball_shortens_and_keeps_the_direction() {
    let ball = Region::of(Bound::ball(5.0));
    let inside = DVec3::new(3.0, -4.0, 0.0);
    assert_eq!(ball.shrink(inside), inside, "as long as the radius is in it");
    let shrunk = ball.shrink(FORCE);
    assert!((shrunk.length() - 5.0).abs() < 1.0e-14 && ball.holds(shrunk), "{shrunk}");
    assert!(shrunk.cross(FORCE).length() < 1.0e-14 * 250.0, "{shrunk}");
    assert!(ball.has_cut(FORCE, shrunk) && !ball.has_cut(inside, inside));
    assert_eq!(Region::of(Bound::ball(0.0)).shrink(FORCE), DVec3::ZERO);
}

#[test]
fn the_tighter_of_ball_and_box_decides() {
    let region = |norm| Region::of(Bound::ball(norm).and(Bound::box_of([3.0, 3.0, 3.0])));
    assert!((region(9.0).shrink(FORCE).y + 3.0).abs() < 1.0e-15, "the box");
    assert!((region(2.0).shrink(FORCE).length() - 2.0).abs() < 1.0e-15, "the ball");
}

#[test]
fn what_is_not_driven_takes_nothing_of_the_norm() {
    let planar = Region::of(Bound::ball(5.0).and(Bound::box_of([9.0, 9.0, 0.0])));
    let sent = planar.shrink(DVec3::new(3.0, 4.0, 700.0));
    assert_eq!(sent, DVec3::new(3.0, 4.0, 0.0));
    assert!(!planar.has_cut(DVec3::new(3.0, 4.0, 700.0), sent));
}

#[test]
fn the_edges_are_in_it_and_their_neighbours_outside_are_not() {
    for size in [0.0, 1.0e-200, 1.0e-3, 1.0, 1.0 / 3.0, 7.3e5] {
        let boxed = Region::of(Bound::box_of([size, 2.0 * size, f64::INFINITY]));
        assert!(boxed.holds(DVec3::new(size, 0.0, 0.0)) && boxed.holds(DVec3::new(-size, 2.0 * size, 0.0)));
        assert!(!boxed.holds(DVec3::new(size.next_up(), 0.0, 0.0)), "{size}");
        assert!(!boxed.holds(DVec3::new(0.0, -(2.0 * size).next_up(), 1.0)), "{size}");
    }
    for radius in [1.0e-3, 1.0, 1.0 / 3.0, 7.3e5] {
        let ball = Region::of(Bound::ball(radius));
        assert!(ball.holds(DVec3::new(0.0, radius, 0.0)) && ball.holds(DVec3::splat(0.577 * radius)));
        assert!(!ball.holds(DVec3::new(0.0, radius * (1.0 + 1.0e-15), 0.0)), "{radius}");
        assert!(!ball.holds(DVec3::splat(0.5774 * radius)), "{radius}");
    }
}

#[test]
fn a_region_without_end_passes_what_is_finite_and_nothing_overflows() {
    let endless = Region::of(Bound::NONE);
    assert_eq!(endless.shrink(FORCE), FORCE);
    let ball = Region::of(Bound::ball(1.0));
    for length in [1.0e154, 1.0e300] {
        let shrunk = ball.shrink(DVec3::new(length, length, 0.0));
        assert!((shrunk.length() - 1.0).abs() < 1.0e-12, "{shrunk}");
        assert!(endless.shrink(DVec3::splat(length)).is_finite());
    }
    // Where how many times it is too long is no number, nothing is left of it.
    assert_eq!(ball.shrink(DVec3::splat(f64::MAX)), DVec3::ZERO);
}

#[test]
fn nothing_is_left_of_what_is_no_number() {
    let (ball, boxed) = (Bound::ball(20.0), Bound::box_of([17.0, 26.0, 35.0]));
    for region in [Bound::NONE, ball, boxed, ball.and(boxed)].map(Region::of) {
        for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for vector in [DVec3::splat(wrong), DVec3::new(1.0, wrong, wrong), DVec3::new(wrong, 0.0, -5.0)] {
                assert_eq!(region.shrink(vector), DVec3::ZERO, "{vector}");
            }
        }
    }
}
