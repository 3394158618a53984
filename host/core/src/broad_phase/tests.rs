use super::*;
use crate::test_random::Random;

fn random_point(random: &mut Random) -> DVec3 {
    DVec3::new(random.symmetric(), random.symmetric(), random.symmetric())
}

fn near(phase: &BroadPhase, position_m: DVec3) -> Vec<usize> {
    let mut objects: Vec<usize> = (0..phase.bounds.len()).collect();
    let mut met = Vec::new();
    phase.for_each_near(&mut objects, position_m, |object| met.push(*object));
    met
}

/// Boxes of all sizes, some objects without one, and what comparing with each of them finds.
#[test]
fn it_finds_what_comparing_with_every_box_finds_in_order() {
    let mut random = Random(7);
    for (objects, size) in [(0, 0.1), (1, 0.1), (3, 2.0), (500, 0.01), (500, 0.3), (2000, 0.0)] {
        let bounds: Vec<Option<Bounds>> = (0..objects)
            .map(|object| {
                let half = DVec3::splat(size) * random_point(&mut random).abs();
                (object % 97 != 5).then(|| Bounds::about(random_point(&mut random), half))
            })
            .collect();
        let phase = BroadPhase::new(bounds.clone());
        let mut any = 0;
        for _ in 0..2000 {
            let at = 1.3 * random_point(&mut random);
            let inside = |(_, bounds): &(usize, &Option<Bounds>)| bounds.is_none_or(|b| b.contains(at));
            let expected: Vec<usize> =
                bounds.iter().enumerate().filter(inside).map(|(object, _)| object).collect();
            any += expected.len();
            assert_eq!(near(&phase, at), expected, "{objects} objects of {size} at {at}");
        }
        assert!(any > 0 || objects < 2 || size == 0.0);
    }
}

#[test]
fn a_box_is_rounded_outwards() {
    let mut random = Random(3);
    for _ in 0..1000 {
        let (center, half) = (random_point(&mut random), random_point(&mut random).abs());
        let bounds = Bounds::about(center, half);
        assert!(bounds.contains(center - half) && bounds.contains(center + half));
    }
}

#[test]
fn a_handle_that_is_nowhere_wakes_only_what_acts_anywhere() {
    let bounds = vec![Some(Bounds::about(DVec3::ZERO, DVec3::ONE)), None];
    assert_eq!(near(&BroadPhase::new(bounds), DVec3::NAN), [1]);
}

#[test]
fn without_boxes_all_are_near_wherever_the_handle_is_until_one_gets_a_box() {
    let mut phase = BroadPhase::new(vec![None; 3]);
    assert_eq!(near(&phase, DVec3::NAN), [0, 1, 2]);
    phase.watch_always(1, Some(Bounds::about(DVec3::ZERO, DVec3::ONE)));
    assert_eq!(near(&phase, DVec3::X * 5.0), [0, 2]);
}

#[test]
fn an_object_that_has_grown_is_found_where_it_is_now() {
    let object = |x| Some(Bounds::about(DVec3::X * x, DVec3::splat(0.1)));
    let mut phase = BroadPhase::new((0..20).map(|index| object(f64::from(index))).collect());
    assert_eq!(near(&phase, DVec3::X * 5.5), [] as [usize; 0]);
    for _ in 0..3 {
        phase.watch_always(5, Some(Bounds::about(DVec3::X * 5.0, DVec3::splat(0.6))));
    }
    phase.watch_always(7, None);
    assert_eq!(near(&phase, DVec3::X * 5.5), [5, 7]);
    assert_eq!(near(&phase, DVec3::X * 5.0), [5, 7]);
}

/// A box takes 56 bytes, its number in the list of those that are always looked at 4, and in each of the up to 8 cells it
/// lies in another 4; the cells themselves are fewer than the objects.
#[test]
fn ten_thousand_objects_side_by_side_take_less_than_100_bytes_each() {
    let at = |index: u32| {
        DVec3::new(f64::from(index % 22), f64::from(index / 22 % 22), f64::from(index / 484)) * 1.0e-3
    };
    let bounds = (0..10_000).map(|i| Some(Bounds::about(at(i), DVec3::splat(0.45e-3)))).collect();
    let phase = BroadPhase::new(bounds);
    let in_cells = phase.grid.objects.iter().map(|cell| size_of_val(cell) + size_of_val(&**cell));
    let bytes =
        size_of_val(&*phase.bounds) + phase.always.capacity() * size_of::<u32>() + in_cells.sum::<usize>();
    assert!(bytes <= 10_000 * 100, "{bytes}");
    let most = phase.grid.objects.iter().map(|cell| cell.len()).max();
    assert!(most <= Some(27), "a cell holds {most:?} objects");
}
