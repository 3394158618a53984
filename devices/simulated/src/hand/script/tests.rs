//! Scripts: their movements, and errors of invalid scripts.

use super::*;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

fn script(steps: &str) -> Script {
    Script::parse("test.toml", steps).unwrap_or_else(|error| panic!("{error}"))
}

fn complaint(text: &str) -> String {
    Script::parse("test.toml", text).expect_err("refused").to_string()
}

fn aim(script: &Script, time_ms: u64) -> Aim {
    script.aim(time_ms * MS).expect("held")
}

#[test]
fn every_built_in_script_can_be_read_and_moves_or_holds() {
    for name in Script::NAMES {
        let script = Script::load(name).unwrap_or_else(|error| panic!("{error}"));
        assert!(script.end_ns() >= 1000 * MS, "{name}");
        assert_eq!(aim(&script, 0).force_n, DVec3::ZERO, "{name} starts without force");
    }
}

#[test]
fn movements_follow_each_other_without_a_gap() {
    for name in Script::NAMES {
        let script = Script::load(name).expect("built in");
        let end_ms = script.end_ns() / MS;
        for time_ms in 0..end_ms {
            let (Some(now), Some(next)) = (script.aim(time_ms * MS), script.aim((time_ms + 1) * MS)) else {
                continue;
            };
            // The fastest built-in movement, a tap: 3 mm in 0.08 s, whose peak speed is 15/8 of the mean.
            let moved_m = (next.pose.position_m - now.pose.position_m).length();
            assert!(moved_m <= 1.0e-3 * 15.0 / 8.0 * 3.0e-3 / 0.08, "{name} at {time_ms} ms: {moved_m}");
            let turned = (now.pose.orientation.conjugate() * next.pose.orientation).xyz().length();
            assert!(turned <= 1.0e-3, "{name} at {time_ms} ms: {turned}");
            assert!((next.force_n - now.force_n).length() <= 0.1, "{name} at {time_ms} ms");
        }
    }
}

#[test]
fn a_move_reaches_its_end_and_what_is_not_named_stays() {
    let script = script(
        "[[step]]\nmove = { to_mm = [1, -2, -4], duration_s = 0.5 }\n\
         [[step]]\nmove = { to_deg = [0, 5, 0], duration_s = 0.5 }\n",
    );
    let half = DVec3::new(0.5e-3, -1.0e-3, -2.0e-3);
    assert!((aim(&script, 250).pose.position_m - half).length() < 1.0e-18);
    for time_ms in [500, 1000, 99_999] {
        assert_eq!(aim(&script, time_ms).pose.position_m, DVec3::new(1.0e-3, -2.0e-3, -4.0e-3));
    }
    let (axis, angle) = aim(&script, 2000).pose.orientation.to_axis_angle();
    assert!((axis - DVec3::Y).length() < 1.0e-12 && (angle - 5.0_f64.to_radians()).abs() < 1.0e-12);
}

#[test]
fn an_oscillation_swings_about_its_place_and_comes_back() {
    let script = script(
        "[[step]]\nmove = { to_mm = [0, 0, -4], duration_s = 0.5 }\n\
         [[step]]\noscillate = { amplitude_mm = [0, 0, 2], frequency_hz = 2, duration_s = 3 }\n",
    );
    let heights_mm: Vec<f64> = (500..=3500).map(|ms| aim(&script, ms).pose.position_m.z * 1.0e3).collect();
    let highest = heights_mm.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // The turning points of 2 Hz fall on whole milliseconds in between: every 125 ms.
    assert!((highest + 2.0).abs() < 1.0e-12, "{highest}");
    assert!((heights_mm[0] + 4.0).abs() < 1.0e-12 && (heights_mm[3000] + 4.0).abs() < 1.0e-12);
}

#[test]
fn a_push_means_a_force_and_yields_along_it() {
    let script = script("[[step]]\npush = { force_n = [0, 0, -6], frequency_hz = 1, pulses = 2 }\n");
    let peak = aim(&script, 500);
    assert!((peak.force_n - DVec3::new(0.0, 0.0, -6.0)).length() < 1.0e-12);
    assert_eq!(peak.yielding, BVec3::new(false, false, true));
    assert_eq!(aim(&script, 2000), Aim::at(Pose::HOME), "afterwards the hand holds again");
    assert_eq!(script.yieldings(), [BVec3::FALSE, BVec3::new(false, false, true)]);
}

#[test]
fn a_release_opens_the_hand_for_good() {
    let script = script("[[step]]\nhold = { duration_s = 0.7 }\n[[step]]\nrelease = {}\n");
    assert_eq!(script.release_ns(), Some(700 * MS));
    assert!(script.aim(700 * MS - 1).is_some() && script.aim(700 * MS).is_none());
}

#[test]
fn a_repeated_sequence_goes_on_from_where_it_was() {
    let script = script(
        "repeat = 3\n[[step]]\nmove = { to_mm = [0, 0, -1], duration_s = 0.1 }\n\
         [[step]]\nmove = { to_mm = [0, 0, 1], duration_s = 0.1 }\n",
    );
    assert_eq!(script.end_ns(), 600 * MS);
    for turn in 0..3 {
        assert_eq!(aim(&script, 200 * turn + 100).pose.position_m.z, -1.0e-3);
    }
}

#[test]
fn complaints_name_file_line_and_key() {
    for (text, expected) in [
        ("step = [\n", "test.toml:"),
        (
            "[[step]]\nmove = { to_mm = [0, 0, -4], duration_s = 0 }\n",
            "test.toml:2: `duration_s`: 0 is outside 0.01",
        ),
        ("[[step]]\nhold = { duration_s = nan }\n", "test.toml:2: `duration_s`: NaN is outside"),
        (
            "\n[[step]]\nmove = { to_mm = [0, 0, -400], duration_s = 1 }\n",
            "test.toml:3: `to_mm`: -400 is outside",
        ),
        ("[[step]]\nmove = { to_mm = [0, 0], duration_s = 1 }\n", "test.toml:2: `to_mm`: "),
        (
            "[[step]]\nhold = { duration_s = 1 }\n[[step]]\nhold = { duratoin_s = 1 }\n",
            "test.toml:4: `hold`: unknown field `duratoin_s`",
        ),
        ("[[step]]\nhold = { }\n", "test.toml:2: `hold`: missing field `duration_s`"),
        ("[[step]]\nwave = { }\n", "test.toml:2: unknown variant `wave`"),
        (
            "[[step]]\noscillate = { frequency_hz = 1000, duration_s = 1 }\n",
            "test.toml:2: `frequency_hz`: 1000 is outside",
        ),
        ("[[step]]\nhold = { duration_s = \"1\" }\n", "test.toml:2: `duration_s`: invalid type: string"),
        (
            "grip = \"soft\"\n[[step]]\nhold = { duration_s = 1 }\n",
            "test.toml:1: `grip`: unknown variant `soft`",
        ),
        ("repeat = 0\n[[step]]\nhold = { duration_s = 1 }\n", "test.toml:1: `repeat`: 0 is outside 1"),
        (
            "[[step]]\npush = { force_n = [0, 0, 1], frequency_hz = 1, pulses = 0.5 }\n",
            "test.toml:2: `pulses`: invalid type: floating",
        ),
        ("title = \"nothing\"\n", "test.toml:1: missing field `step`"),
        ("step = []\n", "test.toml: `step` is empty"),
        (
            "repeat = 9999\n[[step]]\nhold = { duration_s = 1 }\n[[step]]\nhold = { duration_s = 1 }\n",
            "test.toml: the script has 19998 movements",
        ),
        (
            "[[step]]\nrelease = {}\n[[step]]\nhold = { duration_s = 1 }\n",
            "test.toml: [[step]] 1 is `release`",
        ),
    ] {
        let complaint = complaint(text);
        assert!(complaint.starts_with(expected), "{text}\n{complaint}\nnot {expected}");
        assert!(!complaint.contains('\n'), "one line: {complaint}");
    }
}

#[test]
fn what_is_no_file_is_refused_with_the_names_there_are() {
    let error = Script::load("pres").expect_err("no such file");
    assert!(error.to_string().contains("press, hold, release"), "{error}");
    assert!(Script::load("/").is_err(), "a folder is no script");
}

/// Texts that look like scripts: pieces of real ones in any order, with any characters in between.
fn almost_a_script() -> impl Strategy<Value = String> {
    let pieces = prop::sample::select(vec![
        "[[step]]\n",
        "move = {",
        "hold = {",
        "push = {",
        "oscillate = {",
        "release = {}",
        "duration_s = ",
        "to_mm = [",
        "force_n = [",
        "frequency_hz = ",
        "pulses = ",
        "repeat = ",
        "grip = ",
        "\"firm\"",
        "1e308",
        "-0.5",
        "nan",
        "3",
        ", ",
        "]",
        "}",
        "\n",
        "=",
        "\"",
        "step",
        "é",
    ]);
    prop::collection::vec(prop_oneof![4 => pieces.prop_map(str::to_owned), 1 => ".{0,4}"], 0..40)
        .prop_map(|pieces| pieces.concat())
}

proptest! {
    /// Whatever the text says, it is a script or a complaint of one line; a script aims at finite places.
    #[test]
    fn any_text_is_a_script_or_a_complaint(text in prop_oneof![almost_a_script(), ".{0,200}"]) {
        match Script::parse("fuzz", &text) {
            Ok(script) => {
                for time_ns in [0, 1, MS, script.end_ns() / 2, script.end_ns(), u64::MAX] {
                    let finite = script.aim(time_ns).is_none_or(|aim| {
                        aim.pose.position_m.is_finite() && aim.pose.orientation.is_finite() && aim.force_n.is_finite()
                    });
                    prop_assert!(finite, "{time_ns}");
                }
            }
            Err(error) => prop_assert_eq!(error.to_string().lines().count(), 1),
        }
    }

    /// Any legal numbers make a script whose aim stays within the places it names.
    #[test]
    fn a_movement_stays_between_its_ends(
        to_mm in prop::array::uniform3(-100.0..100.0_f64), duration_s in 0.01..10.0_f64, share in 0.0..1.0_f64,
    ) {
        let text = format!("[[step]]\nmove = {{ to_mm = {to_mm:?}, duration_s = {duration_s:?} }}\n");
        let script = Script::parse("fuzz", &text);
        prop_assert!(script.is_ok(), "{text}");
        let script = script.expect("checked");
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let aim = script.aim((share * script.end_ns() as f64) as u64).expect("held");
        let end_m = DVec3::from_array(to_mm) * 1.0e-3;
        // Overshoot: rounding of a tenth of a metre.
        prop_assert!((aim.pose.position_m.length()) <= end_m.length() + 1.0e-16);
        prop_assert!(aim.pose.position_m.dot(end_m) >= 0.0);
    }
}
