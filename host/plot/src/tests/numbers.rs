//! Ticks, ranges, reduction and text: everything before geometry.

use super::super::axis::{Extent, Fit};
use super::super::decimate::decimate;
use super::super::ticks::{Spacing, Ticks};
use super::super::{Axis, text};
use super::{Domain, Point, Scale, Sequence, linear, ten_minutes};
use crate::path::Path;

fn vertical() -> Spacing {
    Spacing::Vertical { pitch_px: 21.0 }
}

/// The number that a tick label shows.
fn shown(label: &str) -> f64 {
    label.replace('\u{2212}', "-").replace('\u{2009}', "").parse().unwrap()
}

#[test]
fn linear_ticks_are_round_evenly_spaced_and_labelled_alike() {
    let mut random = Sequence(1);
    for case in 0..2000 {
        let span = 10.0_f64.powf(random.next() * 24.0 - 12.0);
        let low = (random.next() - 0.5) * 20.0 * span;
        let ticks = Ticks::fit(&linear(low, low + span), 120.0, vertical());
        assert!((2..=6).contains(&ticks.major.len()), "case {case}: {ticks:?}");

        let unit = 10.0_f64.powi(ticks.exponent);
        let values: Vec<f64> = ticks.major.iter().map(|tick| low + tick.position * span).collect();
        let step = values[1] - values[0];
        let mantissa = step / 10.0_f64.powf(step.log10().floor());
        // Ticks lie up to ten spans from zero, so a step carries some 100 rounding errors of its size.
        let nearest =
            [1.0, 2.0, 5.0, 10.0].map(|nice| (mantissa - nice).abs()).into_iter().fold(9.0, f64::min);
        assert!(nearest < 1e-9, "step {step} is not 1, 2 or 5 times a power of ten");
        for pair in values.windows(2) {
            assert!((pair[1] - pair[0] - step).abs() < 1e-9 * step);
        }
        let decimals = |label: &str| label.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        for (tick, value) in ticks.major.iter().zip(&values) {
            assert!((-1e-8..=1.0 + 1e-8).contains(&tick.position));
            assert!((shown(&tick.label) * unit - value).abs() < 1e-6 * step, "{} is not {value}", tick.label);
            assert_eq!(decimals(&tick.label), decimals(&ticks.major[0].label));
        }
        assert!(ticks.minor.len() > ticks.major.len());
    }
}

#[test]
fn zero_has_no_sign_and_thousands_are_grouped() {
    let labels = |low, high| -> Vec<String> {
        Ticks::fit(&linear(low, high), 120.0, vertical()).major.into_iter().map(|tick| tick.label).collect()
    };
    assert_eq!(labels(-1.2, 1.2), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
    assert_eq!(labels(8000.0, 12_000.0), ["8000", "9000", "10\u{2009}000", "11\u{2009}000", "12\u{2009}000"]);
}

#[test]
fn powers_of_ten_move_from_labels_to_the_unit() {
    let ticks = Ticks::fit(&linear(0.0, 4e-6), 120.0, vertical());
    assert_eq!((ticks.exponent, ticks.major[1].label.as_str()), (-6, "1"));
    assert_eq!(Axis::linear("Force", "N").unit_label(ticks.exponent), "(10⁻⁶ N)");
    assert_eq!(Axis::linear("Count", "").unit_label(0), "");
}

#[test]
fn log_ticks_are_decades_or_one_two_five_or_linear() {
    let labels = |low: f64, high: f64| -> Vec<String> {
        let domain = Domain { scale: Scale::Log, low: low.log10(), high: high.log10() };
        Ticks::fit(&domain, 120.0, vertical()).major.into_iter().map(|tick| tick.label).collect()
    };
    assert_eq!(labels(0.01, 1000.0), ["0.01", "0.1", "1", "10", "100", "1000"]);
    assert_eq!(labels(1.0, 1e12), ["10⁰", "10³", "10⁶", "10⁹", "10¹²"]);
    assert_eq!(labels(1.0, 10.0), ["1", "2", "5", "10"]);
    assert_eq!(labels(26.0, 34.0), ["26", "28", "30", "32", "34"]);
}

#[test]
fn labels_side_by_side_keep_their_distance() {
    let mut random = Sequence(2);
    for _ in 0..500 {
        let span = 10.0_f64.powf(random.next() * 12.0 - 6.0);
        let low = (random.next() - 0.5) * 10.0 * span;
        let width = 150.0 + 700.0 * random.next();
        let ticks =
            Ticks::fit(&linear(low, low + span), width, Spacing::Horizontal { gap_px: 26.0, font_px: 11.0 });
        for pair in ticks.major.windows(2) {
            let distance = (pair[1].position - pair[0].position) * width;
            assert!(ticks.major.len() == 2 || distance > text::width_px(&pair[0].label, 11.0) + 20.0);
        }
    }
}

#[test]
fn ranges_surround_the_data() {
    let domain = |axis: Axis, low: f64, high: f64, fit| {
        let mut extent = Extent::EMPTY;
        [low, high]
            .into_iter()
            .filter_map(|value| axis.scale.forward(value))
            .for_each(|value| extent.include(value));
        let domain = axis.domain(extent, fit);
        (domain.low, domain.high)
    };
    let axis = || Axis::linear("", "");
    assert_eq!(domain(axis(), 0.0, 9.999, Fit::Tight), (0.0, 10.0));
    assert_eq!(domain(axis(), 0.2, 9.5, Fit::Tight), (0.2, 9.5));
    assert_eq!(domain(axis(), 1.0, 100.0, Fit::Padded).0, 0.0, "a near zero is the end");
    assert!(domain(axis(), 90.0, 100.0, Fit::Padded).0 > 80.0, "a far zero is not");
    assert_eq!(domain(axis(), 90.0, 100.0, Fit::OnZero).0, 0.0, "bars stand on zero");
    assert_eq!(domain(axis(), 5.0, 5.0, Fit::Padded), (4.5, 5.5));
    assert_eq!(domain(axis(), 0.0, 0.0, Fit::Padded), (-1.0, 1.0));
    assert_eq!(domain(axis().range(3.0, 1.0), 0.0, 9.0, Fit::Padded), (1.0, 3.0));
    assert_eq!(domain(axis().range(f64::NAN, 1.0), 0.0, 10.0, Fit::Tight), (0.0, 10.0));
    assert_eq!(domain(Axis::log("", "").range(-1.0, 10.0), 1.0, 100.0, Fit::Tight), (0.0, 2.0));
}

#[test]
fn every_bucket_keeps_its_first_lowest_highest_and_last_sample() {
    let samples = ten_minutes();
    let width = 0.75;
    let runs = decimate(samples.iter().copied().map(Some), width);
    assert_eq!(runs.len(), 1);
    let bucket_of = |point: &Point| (point.0 / width).floor();
    let mut kept = runs[0].as_slice();
    for bucket in samples.chunk_by(|one, other| bucket_of(one) == bucket_of(other)) {
        let in_bucket = kept.iter().take_while(|point| bucket_of(point) == bucket_of(&bucket[0])).count();
        let (here, rest) = kept.split_at(in_bucket);
        kept = rest;
        let lowest = |points: &[Point]| points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        let highest = |points: &[Point]| points.iter().map(|point| point.1).fold(f64::NEG_INFINITY, f64::max);
        assert!(here.len() <= 4);
        assert_eq!((here.first(), here.last()), (bucket.first(), bucket.last()));
        assert_eq!((lowest(here), highest(here)), (lowest(bucket), highest(bucket)));
        assert!(here.is_sorted_by(|one, other| one.0 < other.0), "in the order of the samples");
    }
    assert!(kept.is_empty());
}

#[test]
fn a_growing_series_keeps_its_finished_buckets() {
    let samples = ten_minutes();
    let reduce = |samples: &[Point]| decimate(samples.iter().copied().map(Some), 0.75).concat();
    let (whole, part) = (reduce(&samples), reduce(&samples[..300_123]));
    // Only the bucket that the shorter series leaves unfinished (at most four samples) may differ.
    assert_eq!(whole[..part.len() - 4], part[..part.len() - 4]);
    // Dropping the start shifts nothing either: buckets count from x = 0.
    let late = reduce(&samples[200_321..]);
    assert_eq!(whole[whole.len() - late.len() + 4..], late[4..]);
}

#[test]
fn text_is_escaped_shortened_and_wrapped() {
    assert_eq!(
        text::escape("<a href=\"x\">&'\u{0}\n"),
        "&lt;a href=&quot;x&quot;&gt;&amp;&#39;\u{fffd}&#10;"
    );
    assert_eq!([-0.04, -0.0, -0.06].map(|value| text::decimal(value, 1)), ["0.0", "0.0", "−0.1"]);
    assert_eq!(text::significant(-1234.56), "−1235");
    assert_eq!(text::significant(0.012_345_6), "0.0123");
    assert_eq!(text::significant(2.0), "2");
    for limit in [60.0, 100.0, 300.0] {
        let words = "several words and one thatislongerthanthewholelineisallowedtobe in the middle";
        for line in text::wrap(words, limit, 12.0) {
            assert!(text::width_px(&line, 12.0) <= limit, "{line}");
        }
    }
    assert_eq!(text::shorten("fits", 100.0, 12.0), "fits");
}

#[test]
fn coordinates_are_short() {
    let written = [12.34, 0.26, -0.26, -0.04, 7.0, -3.0, 1e5].map(text::px);
    assert_eq!(written, ["12.3", ".3", "-.3", "0", "7", "-3", "100000"]);
}

#[test]
fn a_level_stretch_of_a_line_is_one_step() {
    let mut path = Path::default();
    let level = (0..100).map(|x| (f64::from(x), 2.0));
    path.polyline(level.chain([(99.0, 3.0), (100.0, 3.0), (105.5, 3.0), (101.0, 3.0), (101.0, 3.0)]));
    assert_eq!(path.data, "M0 2h99v1h6.5h-4.5");
    path.polyline([(0.0, 3.0), (1.0, 3.0)]);
    assert_eq!(path.data, "M0 2h99v1h6.5h-4.5M0 3h1");
}
