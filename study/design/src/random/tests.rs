use super::*;

#[test]
fn every_part_of_the_name_makes_another_stream_and_the_same_name_the_same() {
    let draw = |seed, purpose, subject, index| Stream::new(seed, purpose, subject, index).uniform();
    let first = draw(1, Purpose::Answer, 2, 3);
    assert_eq!(first, draw(1, Purpose::Answer, 2, 3));
    for other in [
        draw(2, Purpose::Answer, 2, 3),
        draw(1, Purpose::Schedule, 2, 3),
        draw(1, Purpose::Answer, 3, 3),
        draw(1, Purpose::Answer, 2, 4),
    ] {
        assert_ne!(first, other);
    }
}

/// Neighbouring streams are independent: the first normal numbers of 40 000 of them have the moments of the
/// distribution to four standard errors.
#[test]
fn first_draws_of_neighbouring_streams_are_normal() {
    const STREAMS: u32 = 40_000;
    let (mut mean, mut square) = (0.0, 0.0);
    for index in 0..STREAMS {
        let x = Stream::new(5, Purpose::Answer, 1, index).normal();
        mean += x;
        square += x * x;
    }
    let n = f64::from(STREAMS);
    assert!((mean / n).abs() < 4.0 / n.sqrt());
    assert!((square / n - 1.0).abs() < 4.0 * 2.0_f64.sqrt() / n.sqrt());
}

#[test]
fn shuffles_are_even() {
    let mut counts = [0_u32; 6];
    for index in 0..6000 {
        let mut list = [0_usize, 1, 2];
        Stream::new(9, Purpose::Schedule, 1, index).shuffle(&mut list);
        counts[list[0] * 2 + usize::from(list[1] > list[2])] += 1;
    }
    // Four standard deviations of a binomial count of mean 1000.
    assert!(counts.iter().all(|count| count.abs_diff(1000) < 116), "{counts:?}");
}
