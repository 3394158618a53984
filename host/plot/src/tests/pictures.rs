//! Outlines, labels and whole documents.

use super::super::axis::Extent;
use super::super::drawing::{Drawing, draw};
use super::super::labels::{side_labels, top_labels};
use super::super::projection::{Projection, Rect};
use super::super::theme::Slot;
use super::super::{Axis, Bin, ErrorBar, Figure, Mark, Panel, Quantity, Series, Spans, text};
use super::{Domain, Point, Scale, linear, ten_minutes};

const FRAME: Rect = Rect { left: 80.0, top: 50.0, width: 800.0, height: 120.0 };

/// Coordinates are rounded to a tenth of a pixel: half of that, and a little for the arithmetic around it.
const ROUNDING_PX: f64 = 0.05 + 1e-6;

/// Corner points of each subpath of relative path data made of M, l, h, v and z.
fn subpaths(data: &str) -> Vec<Vec<Point>> {
    let mut subpaths: Vec<Vec<Point>> = Vec::new();
    let mut at = (0.0, 0.0);
    let mut rest = data;
    while let Some(command) = rest.chars().next() {
        let body = &rest[1..];
        let end = body.find(|character: char| character.is_ascii_alphabetic()).unwrap_or(body.len());
        let spaced = body[..end].replace('-', " -");
        let numbers: Vec<f64> = spaced.split_whitespace().map(|number| number.parse().unwrap()).collect();
        rest = &body[end..];
        at = match (command, numbers.as_slice()) {
            ('M', &[x, y]) => {
                subpaths.push(Vec::new());
                (x, y)
            }
            ('l', &[dx, dy]) => (at.0 + dx, at.1 + dy),
            ('h', &[dx]) => (at.0 + dx, at.1),
            ('v', &[dy]) => (at.0, at.1 + dy),
            ('z', &[]) => continue,
            _ => panic!("{command} {numbers:?}"),
        };
        subpaths.last_mut().unwrap().push(at);
    }
    subpaths
}

fn line_of(series: &Series, projection: &Projection) -> (Vec<Vec<Point>>, Vec<Vec<Point>>, bool) {
    match draw(series, Slot::new(0), projection) {
        Some(Drawing::Line { path, dots, busy, .. }) => (subpaths(&path.data), subpaths(&dots.data), busy),
        other => panic!("not a line: {other:?}"),
    }
}

#[test]
fn peaks_reach_the_picture_and_rounding_does_not_add_up() {
    let samples = ten_minutes();
    let projection = Projection { x: linear(0.0, 600.0), y: linear(0.0, 6.0), frame: FRAME };
    let (path, _, busy) = line_of(&Series::line("", samples.clone()), &projection);
    assert!(busy, "noise is drawn without dashes");
    for &(x, y) in samples.iter().filter(|sample| sample.1 > 2.0) {
        let (x, y) = (projection.x_px(x), projection.y_px(y));
        let near = |point: &&Point| (point.0 - x).abs() <= ROUNDING_PX && (point.1 - y).abs() <= ROUNDING_PX;
        assert_eq!(path[0].iter().filter(near).count(), 1);
    }
    let (last, end) = (samples.last().unwrap(), path[0].last().unwrap());
    assert!((end.0 - projection.x_px(last.0)).abs() <= ROUNDING_PX);
    assert!((end.1 - projection.y_px(last.1)).abs() <= ROUNDING_PX);

    let figure = |samples: &[Point]| {
        let panel = Panel::new(Axis::linear("", "")).series(Series::line("", samples.to_vec()));
        Figure::new("", Axis::linear("", "")).panel(panel).to_svg().len()
    };
    // Four samples in each of about 900 columns, each some eight characters, and the style sheet.
    assert!(figure(&samples) < 900 * 4 * 9 + 5000);
}

#[test]
fn bad_samples_break_the_line_and_nothing_else() {
    let projection = Projection { x: linear(0.0, 10.0), y: linear(0.0, 10.0), frame: FRAME };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let samples = [(1.0, 1.0), (2.0, 2.0), (3.0, bad), (4.0, 4.0), (bad, 5.0), (6.0, 6.0), (7.0, 7.0)];
        let series = Series::line("", samples);
        let (path, dots, _) = line_of(&series, &projection);
        assert_eq!(path.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
        assert_eq!(dots.len(), 1, "the sample between two gaps is a dot");
        assert_eq!(series.extent_y(&projection.x, Scale::Linear), Extent { low: 1.0, high: 7.0 });

        let (path, ..) = line_of(&Series::steps("", samples), &projection);
        assert_eq!(path.iter().map(Vec::len).collect::<Vec<_>>(), [3, 3], "no value is held across a gap");
    }
    let log = Projection { y: Domain { scale: Scale::Log, low: 0.0, high: 1.0 }, ..projection };
    let (path, ..) = line_of(
        &Series::line("", [(1.0, 1.0), (2.0, 2.0), (3.0, 0.0), (4.0, -1.0), (5.0, 3.0), (6.0, 3.0)]),
        &log,
    );
    assert_eq!(path.len(), 2);
}

#[test]
fn a_single_sample_is_a_marker_and_none_is_nothing() {
    let projection = Projection { x: linear(0.0, 1.0), y: linear(0.0, 1.0), frame: FRAME };
    assert!(matches!(
        draw(&Series::line("", [(0.5, 0.5)]), Slot::new(0), &projection),
        Some(Drawing::Markers(_))
    ));
    assert!(draw(&Series::line("", []), Slot::new(0), &projection).is_none());
    assert!(draw(&Series::points("", [(f64::NAN, 0.0)]), Slot::new(0), &projection).is_none());
}

#[test]
fn bars_that_touch_share_an_outline_that_stands_on_the_axis() {
    let bin = |from: f64, height: f64| Bin { from, to: from + 1.0, height };
    let bins = [
        bin(1.0, 2.0),
        bin(2.0, 3.0),
        bin(5.0, 1.0),
        bin(6.0, f64::NAN),
        Bin { from: 9.0, to: 8.0, height: 1.0 },
    ];
    let projection = Projection { x: linear(0.0, 10.0), y: linear(0.0, 4.0), frame: FRAME };
    let Some(Drawing::Bars(path)) = draw(&Series::histogram("", bins), Slot::new(0), &projection) else {
        panic!()
    };
    let outlines = subpaths(&path.data);
    let expect = |corners: &[Point]| -> Vec<Point> {
        corners.iter().map(|&(x, y)| (80.0 + 80.0 * x, 170.0 - 30.0 * y)).collect()
    };
    assert_eq!(
        outlines[0],
        expect(&[(1.0, 0.0), (1.0, 2.0), (2.0, 2.0), (2.0, 3.0), (3.0, 3.0), (3.0, 0.0)])
    );
    assert_eq!(outlines[1], expect(&[(5.0, 0.0), (5.0, 1.0), (6.0, 1.0), (6.0, 0.0)]));
    assert_eq!(outlines.len(), 2);

    // On a log axis a bin from zero reaches half a decade down; one from below zero has no place.
    assert_eq!(Bin { from: 0.0, to: 1.0, height: 1.0 }.edges(Scale::Log), Some((-0.5, 0.0)));
    assert_eq!(Bin { from: -1.0, to: 10.0, height: 1.0 }.edges(Scale::Log), None);
}

#[test]
fn markers_that_cover_one_another_are_drawn_once() {
    let projection = Projection { x: linear(0.0, 10.0), y: linear(0.0, 10.0), frame: FRAME };
    let count =
        |samples: &[Point]| match draw(&Series::points("", samples.to_vec()), Slot::new(0), &projection) {
            Some(Drawing::Markers(path)) => path.data.matches('M').count(),
            other => panic!("{other:?}"),
        };
    assert_eq!(count(&[(1.0, 1.0); 100_000]), 1);
    assert_eq!(count(&[(1.0, 1.0), (1.0, 2.0), (2.0, 1.0)]), 3);
}

#[test]
fn sixty_four_series_look_different() {
    let looks: Vec<Slot> = (0..64).map(Slot::new).collect();
    for (index, look) in looks.iter().enumerate() {
        assert!(!looks[..index].contains(look));
    }
}

#[test]
fn names_of_marks_keep_apart() {
    let projection = Projection { x: linear(0.0, 10.0), y: linear(0.0, 10.0), frame: FRAME };
    let levels: Vec<Mark> = [9.9, 9.8, 9.7, 0.1, 0.0].map(|y| Mark::at_y(y, "limit")).to_vec();
    let labels = side_labels(&levels, &projection);
    assert_eq!(labels.len(), 5);
    for pair in labels.windows(2) {
        assert!(pair[1].middle - pair[0].middle >= 14.0 - 1e-9);
    }
    assert!(labels.iter().all(|label| (FRAME.top..=FRAME.bottom()).contains(&label.middle)));

    for times in [&[5.0, 5.1, 5.2, 9.9][..], &[9.7, 9.9, 9.95], &[0.1, 9.0, 9.6, 9.8], &[9.9]] {
        let marks: Vec<Mark> = times.iter().map(|x| Mark::at_x(*x, "a long name")).collect();
        let labels = top_labels(&marks, &projection.x, FRAME.left, FRAME.right());
        assert_eq!(labels.len(), times.len());
        let end = |start: f64| start + text::width_px("a long name", 11.5);
        for (index, one) in labels.iter().enumerate() {
            assert!(end(one.start()) <= FRAME.right() + 24.0);
            for (other_index, other) in labels.iter().enumerate().filter(|(other, _)| *other != index) {
                let apart = end(one.start()) <= other.start() || end(other.start()) <= one.start();
                assert!(one.row != other.row || apart, "{one:?} {other:?}");
                let is_crossed =
                    other.row > one.row && (one.start()..end(one.start())).contains(&other.anchor);
                assert!(!is_crossed, "the pole of {other_index}, {other:?}, crosses {one:?}");
            }
        }
    }
}

#[test]
fn marks_outside_or_without_a_place_are_left_out() {
    let domain = linear(0.0, 10.0);
    assert_eq!(Mark::at_y(5.0, "").visible(&domain), Some(5.0));
    assert_eq!(Mark::at_y(11.0, "").visible(&domain), None);
    assert_eq!(Mark::at_y(f64::INFINITY, "").visible(&domain), None);
    assert_eq!(Mark::at_y(f64::NAN, "").visible(&domain), None);
}

/// Checks what XML 1.0 asks of a document of this kind: one root, balanced tags, quoted attributes that do
/// not repeat, known entities, no forbidden character. Returns the element names.
fn well_formed(document: &str) -> Vec<String> {
    let is_text = |text: &str| {
        let entities = ["amp;", "lt;", "gt;", "quot;", "#39;"];
        text.split('&').skip(1).all(|rest| entities.iter().any(|entity| rest.starts_with(entity)))
            && !text
                .chars()
                .any(|character| (character < ' ' && character != '\n') || character == '\u{ffff}')
            && !text.contains('>')
    };
    let mut open: Vec<&str> = Vec::new();
    let mut names = Vec::new();
    let mut rest = document;
    while let Some(start) = rest.find('<') {
        assert!(is_text(&rest[..start]), "text {:?}", &rest[..start]);
        let (tag, after) = rest[start + 1..].split_once('>').expect("a tag ends");
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
            continue;
        }
        let (tag, is_empty) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
        let (name, mut attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        assert!(!open.is_empty() || names.is_empty(), "one root");
        names.push(name.to_owned());
        let mut keys = Vec::new();
        while !attributes.trim().is_empty() {
            let (key, value) = attributes.trim().split_once("=\"").expect("a quoted attribute");
            let (value, after) = value.split_once('"').expect("a closing quote");
            assert!(is_text(value) && !value.contains('<') && !keys.contains(&key), "{key}={value}");
            let is_number = matches!(key, "x" | "y" | "width" | "height");
            assert!(!is_number || value.parse::<f64>().is_ok_and(f64::is_finite), "{key}={value}");
            assert!(key != "d" || !value.contains(['N', 'i', 'e']), "{value}");
            keys.push(key);
            attributes = after;
        }
        if !is_empty {
            open.push(name);
        }
    }
    assert!(open.is_empty() && rest.trim().is_empty(), "unclosed {open:?}");
    names
}

/// Values at the edges of what a float holds.
const EXTREMES: [f64; 11] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    5e-324,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
];

#[test]
fn any_input_makes_a_well_formed_document() {
    let hostile = "</text><script>\"'&\u{0}\u{7}\u{ffff}";
    for axis in [Axis::linear(hostile, hostile), Axis::log(hostile, hostile)] {
        for &one in &EXTREMES {
            for &other in &EXTREMES {
                let samples = [(one, other), (other, one), (one, one)];
                let bins =
                    [Bin { from: one, to: other, height: one }, Bin { from: 0.0, to: 1.0, height: other }];
                let panel = Panel::new(axis.clone().range(one, other))
                    .title(hostile)
                    .series(Series::line(hostile, samples))
                    .series(Series::steps("", samples))
                    .series(Series::points(hostile, samples))
                    .series(Series::histogram(hostile, bins).slot(usize::MAX))
                    .mark(Mark::at_x(one, hostile))
                    .mark(Mark::at_y(other, hostile));
                let free = Panel::with_x(axis.clone(), axis.clone()).series(Series::line("", samples));
                let figure = Figure::new(hostile, axis.clone()).panel_height_px(other).columns(2);
                let svg = figure.subtitle(hostile).panel(panel).panel(free).to_svg();
                assert!(!well_formed(&svg).contains(&"script".to_owned()));
            }
        }
    }
}

/// The label of each tick of the only panel's y axis.
fn y_labels(svg: &str) -> Vec<String> {
    let texts = svg.split("<text class=\"muted end\"").skip(1);
    texts.filter_map(|text| Some(text.split_once('>')?.1.split_once('<')?.0.to_owned())).collect()
}

/// A hand that does not turn has rotations of rounding errors.
#[test]
fn rounding_errors_lie_flat_on_an_axis_with_a_least_range() {
    let noise = |unit: f64| (0..1000_u32).map(move |i| (f64::from(i), unit * f64::from(i % 7) - 3.0 * unit));
    let picture = |axis: Axis, unit: f64| {
        let panel = Panel::new(axis).series(Series::line("", noise(unit)));
        Figure::new("", Axis::linear("Time", "s")).panel(panel).to_svg()
    };
    for (quantity, noise) in [
        (Quantity::Angle, 1.0e-18),
        (Quantity::Length, 1.0e-12),
        (Quantity::Force, 1.0e-13),
        (Quantity::Torque, 1.0e-15),
        (Quantity::Energy, 1.0e-15),
    ] {
        let svg = picture(Axis::of("Noise", quantity), noise);
        let heights: Vec<f64> = drawn(&svg, "line").iter().map(|(_, y)| *y).collect();
        let (low, high) = heights.iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        assert!(heights.len() > 1 && high - low < 0.11, "{quantity:?}: {low} to {high}");
        let signal = picture(Axis::of("Noise", quantity), quantity.least_range_si() * quantity.unit().1);
        assert!(drawn(&signal, "line").len() > 100, "{quantity:?}: a signal is drawn as one");
    }
    let constant =
        Panel::new(Axis::of("Force", Quantity::Force)).series(Series::line("", [(0.0, 0.0), (1.0, 0.0)]));
    let svg = Figure::new("", Axis::linear("Time", "s")).panel(constant).to_svg();
    assert!(y_labels(&svg).iter().all(|label| !label.contains("1.0")), "{:?}", y_labels(&svg));
}

#[test]
fn bars_with_a_least_range_stand_on_zero() {
    let bins = [Bin { from: 0.0, to: 1.0, height: 1.0e-9 }];
    let panel = Panel::new(Axis::of("Force", Quantity::Force)).series(Series::histogram("", bins));
    let svg = Figure::new("", Axis::linear("", "")).panel(panel).to_svg();
    assert_eq!(y_labels(&svg).first().map(String::as_str), Some("0.0"), "{:?}", y_labels(&svg));
    let log = Panel::new(Axis::log("Time", "ns")).series(Series::line("", [(0.0, 100.0), (1.0, 100.001)]));
    let svg = Figure::new("", Axis::linear("", "")).panel(log).to_svg();
    let heights: Vec<f64> = drawn(&svg, "line").iter().map(|(_, y)| *y).collect();
    assert!(heights.iter().all(|y| (y - heights[0]).abs() < 0.2), "{heights:?}");
}

/// Four lines in one place, as a fitted spring, its knots and the curve itself.
#[test]
fn lines_over_one_another_have_widths_of_their_own() {
    let line = |count: u32| {
        (0..=count).map(move |i| (f64::from(i) / f64::from(count), f64::from(i) / f64::from(count)))
    };
    let figure = |panel: Panel| Figure::new("", Axis::linear("", "")).panel(panel).to_svg();
    let svg = figure([1, 7, 100, 3000].into_iter().fold(Panel::new(Axis::linear("", "")), |panel, count| {
        panel.series(Series::line(count.to_string(), line(count)))
    }));
    for (class, slot) in [("under3", "s0"), ("under2", "s1"), ("under1", "s2")] {
        let found = svg.matches(&format!("{class} {slot}\"")).count();
        assert_eq!(found, 2, "{class}: the line and its sample in the legend");
    }
    let apart = figure(
        Panel::new(Axis::linear("", ""))
            .series(Series::line("up", [(0.0, 0.0), (1.0, 1.0)]))
            .series(Series::line("down", [(0.0, 1.0), (1.0, 0.0)])),
    );
    assert!(!apart.split("</style>").nth(1).expect("a body").contains("under"), "nothing is covered");
}

#[test]
fn a_fault_has_a_cross_and_a_limit_a_bar_at_the_foot() {
    let mut limited = Spans::default();
    [0.2, 0.3, 0.4].into_iter().for_each(|x| limited.extend(x));
    limited.interrupt();
    limited.extend(0.9);
    let panel = Panel::new(Axis::linear("Force", "N"))
        .series(Series::line("z", [(0.0, 0.0), (1.0, 1.0)]).axis(2))
        .mark(Mark::fault_at_x(0.5, "device fault"))
        .limited(limited);
    let svg = Figure::new("", Axis::linear("Time", "s")).panel(panel).to_svg();
    well_formed(&svg);
    let data = svg.split("<path class=\"fault\" d=\"").nth(1).and_then(|rest| rest.split('"').next());
    let strokes = subpaths(data.expect("a fault is drawn"));
    assert_eq!(strokes.len(), 3, "a line and a cross: {strokes:?}");
    let height = (strokes[0][0].1 - strokes[0][1].1).abs();
    assert!((height - 120.0).abs() < 0.2, "over the whole height: {height}");
    let bars = subpaths(
        svg.split("<path class=\"limited\" d=\"")
            .nth(1)
            .and_then(|rest| rest.split('"').next())
            .expect("a bar"),
    );
    assert_eq!(bars.len(), 2, "{bars:?}");
    assert!(bars[1][2].0 - bars[1][0].0 >= 1.4, "one tick is seen: {bars:?}");
    assert!(svg.contains(">device fault<"));
}

#[test]
fn error_bars_have_caps_and_widen_the_axis() {
    let bars = [ErrorBar::around(1.0, 5.0, 2.0), ErrorBar::around(2.0, 5.0, f64::NAN)];
    let panel =
        Panel::new(Axis::linear("", "").with_zero()).series(Series::errors("one error", bars).slot(6));
    let svg = Figure::new("", Axis::linear("", "").range(0.0, 3.0)).panel(panel).to_svg();
    let body = svg.split("</style>").nth(1).expect("a body");
    let data = body.split("<path class=\"errors s6\" d=\"").nth(1).and_then(|rest| rest.split('"').next());
    let strokes = subpaths(data.expect("the bar"));
    assert_eq!(strokes.len(), 3, "a stem and two caps: {strokes:?}");
    assert_eq!(y_labels(&svg).first().map(String::as_str), Some("0"), "{:?}", y_labels(&svg));
}

/// The elements that CairoSVG, svglib, Inkscape, librsvg and browsers all draw as they are meant.
const DRAWN_EVERYWHERE: [&str; 9] = ["svg", "title", "desc", "style", "rect", "g", "path", "text", "tspan"];

#[test]
fn a_picture_uses_only_what_every_program_draws() {
    let samples = || (0..100).map(|index| (f64::from(index), f64::from(index % 7)));
    let bins = [Bin { from: 0.0, to: 50.0, height: 3.0 }, Bin { from: 50.0, to: 90.0, height: 9.0 }];
    let mut limited = Spans::default();
    limited.extend(10.0);
    let panel = Panel::new(Axis::linear("Force", "N").range(1.0, 5.0))
        .series(Series::line("x", samples()).axis(0))
        .series(Series::steps("held", samples()))
        .series(Series::points("seen", samples()))
        .series(Series::histogram("counts", bins))
        .series(Series::errors("errors", [ErrorBar::around(20.0, 3.0, 1.0)]))
        .series(Series::line("the same", samples()))
        .limited(limited)
        .mark(Mark::fault_at_x(40.0, "device fault"))
        .mark(Mark::at_x(30.0, "fault"))
        .mark(Mark::at_y(4.0, "limit"));
    for paper in [crate::Paper::OfReader, crate::Paper::Light, crate::Paper::Dark] {
        let figure = Figure::new("Run", Axis::linear("Time", "s")).paper(paper).panel(panel.clone());
        let svg = figure.to_svg();
        let names = well_formed(&svg);
        assert!(names.iter().all(|name| DRAWN_EVERYWHERE.contains(&name.as_str())), "{names:?}");
        assert_eq!(names.iter().filter(|name| *name == "svg").count(), 1, "no nested document");
        for missing_somewhere in
            ["currentColor", "var(", "height:auto", "max-width", "color:#", "url(", " id="]
        {
            let found = svg.replace("currentcolor", "currentColor");
            assert!(!found.contains(missing_somewhere), "{missing_somewhere}");
        }
        // Each class of a shape has a rule outside the media query, which some programs skip.
        let (style, body) = svg.split_once("</style>").expect("a style sheet");
        let rules = style.split("@media").next().expect("the rules of all pages");
        for class in body.split("<path class=\"").skip(1).filter_map(|rest| rest.split('"').next()) {
            assert!(class.split(' ').all(|class| rules.contains(&format!(".plot .{class}{{"))), "{class}");
        }
    }
}

/// Corners of every line and marker in a document of one panel.
fn drawn(svg: &str, class: &str) -> Vec<Point> {
    let start = format!("<path class=\"{class}");
    let paths = svg.split(&start).skip(1);
    let data = paths.filter_map(|rest| rest.split(" d=\"").nth(1)?.split('"').next());
    data.flat_map(subpaths).flatten().collect()
}

#[test]
fn data_outside_a_fixed_range_stay_within_the_frame() {
    let samples = [(0.0, 0.5), (1.0, 40.0), (2.0, 0.5), (30.0, 0.2), (3.0, -5.0)];
    let axis = || Axis::linear("", "").range(0.0, 1.0);
    let shown = |series: Series| {
        let x = Axis::linear("", "").range(0.0, 10.0);
        Figure::new("", x).panel(Panel::new(axis()).series(series)).to_svg()
    };
    let ground = shown(Series::line("", [(0.0, 0.0), (0.0, 1.0), (10.0, 1.0), (10.0, 0.0)]));
    let corners = drawn(&ground, "line");
    let (least, most) =
        corners.iter().fold(((f64::MAX, f64::MAX), (f64::MIN, f64::MIN)), |(low, high), at| {
            ((low.0.min(at.0), low.1.min(at.1)), (high.0.max(at.0), high.1.max(at.1)))
        });
    for (class, series) in [
        ("line", Series::line("", samples)),
        ("line", Series::steps("", samples)),
        ("bars", Series::histogram("", [Bin { from: -5.0, to: 4.0, height: 9.0 }])),
    ] {
        let points = drawn(&shown(series), class);
        assert!(points.len() >= 3, "{class}: {points:?}");
        for (x, y) in points {
            let is_within =
                (least.0 - 0.1..=most.0 + 0.1).contains(&x) && (least.1 - 0.1..=most.1 + 0.1).contains(&y);
            assert!(is_within, "{class}: {x} {y} outside {least:?} {most:?}");
        }
    }
    assert_eq!(shown(Series::points("", samples)).matches("<path class=\"points").count(), 1);
}

#[test]
fn empty_figures_and_panels_say_so() {
    let axis = || Axis::linear("Time", "s");
    assert_eq!(well_formed(&Figure::new("", axis()).to_svg())[..4], ["svg", "title", "desc", "style"]);
    let svg = Figure::new("", axis()).panel(Panel::new(axis()).series(Series::line("force", []))).to_svg();
    well_formed(&svg);
    assert!(svg.contains(">no data<") && svg.contains(">force (no data)<"));
}

#[test]
fn the_description_tells_what_the_picture_shows() {
    let panel = Panel::new(Axis::linear("Force", "N")).series(Series::line("z", [(0.0, -1.5), (1.0, 2.0)]));
    let svg = Figure::new("Run", Axis::linear("Time", "s")).subtitle("Seed 1.").panel(panel).to_svg();
    assert!(svg.contains("<title>Run</title>"));
    assert!(
        svg.contains("<desc>Seed 1. Force (N) against Time (s): z, 2 samples, −1.5 to 2.</desc>"),
        "{svg}"
    );
}

#[test]
fn x_labels_stand_once_at_the_foot_of_panels_that_share_an_axis() {
    let panel = || Panel::new(Axis::linear("y", "")).series(Series::line("", [(0.0, 0.0), (1.0, 1.0)]));
    let figure = |columns| Figure::new("", Axis::linear("Time", "s")).columns(columns);
    let count = |figure: Figure| figure.to_svg().matches(">Time (s)<").count();
    assert_eq!(count(figure(1).panel(panel()).panel(panel()).panel(panel())), 1);
    assert_eq!(count(figure(2).panel(panel()).panel(panel()).panel(panel()).panel(panel())), 2);
    let own = || Panel { own_x: Some(Axis::linear("Position", "mm")), ..panel() };
    let mixed = figure(1).panel(own()).panel(panel()).panel(own()).to_svg();
    assert_eq!((mixed.matches(">Time (s)<").count(), mixed.matches(">Position (mm)<").count()), (1, 2));
}

#[test]
fn a_picture_has_the_size_and_the_paper_it_was_given() {
    let panel = |name: &str| {
        Panel::new(Axis::linear(name, "N")).series(Series::line("z", [(0.0, 1.0), (1.0, 2.0)]).axis(2))
    };
    let figure = Figure::new("Run", Axis::linear("Time", "s")).panel(panel("Force")).panel(panel("Limit"));
    let svg = figure.clone().size_px([640.0, 480.0]).paper(crate::Paper::Light).to_svg();
    well_formed(&svg);
    assert!(svg.contains("width=\"640\" height=\"480\" viewBox=\"0 0 640 480\""), "{}", &svg[..200]);
    assert!(!svg.contains("prefers-color-scheme") && svg.contains("#144a9b") && !svg.contains("#96d0ff"));
    let dark = figure.clone().paper(crate::Paper::Dark).to_svg();
    assert!(dark.contains("#96d0ff") && !dark.contains("#144a9b"));
    assert_eq!(figure.to_svg().matches(" s10\"").count(), 4, "z is z in both panels and legends");
}
