//! `flotor jitter`: servo and bare loop in turns, on the machine's clock.

use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use serde_json::Value;

#[test]
fn every_period_of_both_loops_is_a_tick_or_missed() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::alone();
    let scratch = Scratch::default();
    let picture = scratch.path().join("jitter.svg").display().to_string();
    let arguments = ["jitter", "--rate", "500", "--duration", "4s", "--json", "-", "--plot", &picture];
    let ran = Flotor::with(arguments).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let drawn = std::fs::read_to_string(&picture).expect("there is a picture");
    assert!(drawn.starts_with("<svg") && drawn.contains("bare loop"), "{drawn}");
    let report: Value = serde_json::from_str(&ran.stdout).expect("the result is JSON");
    assert_eq!(report["slices"], 2);
    let mut missed = [0, 0];
    for (name, missed) in ["servo", "bare"].iter().zip(&mut missed) {
        let count =
            |key: &str| report[name][key].as_i64().unwrap_or_else(|| panic!("{name}.{key}: {report}"));
        // Two slices of a second; the last tick of one may come after its end.
        let periods = count("ticks") + count("missed_ticks");
        assert!(periods >= 1000, "{name}: {periods} periods");
        assert!(count("ticks") <= 1000 && count("late_ticks") <= count("ticks"), "{report}");
        *missed = count("missed_ticks");
    }
    let [servo, bare] = missed;
    assert_eq!(report["missed_more"]["ticks"].as_f64(), Some((servo - bare) as f64));
    assert!(report["missed_more"]["standard_error"].as_f64().is_some_and(|error| error >= 0.0), "{report}");
}
