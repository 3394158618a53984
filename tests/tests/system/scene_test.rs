//! `flotor test` as a user meets it: green for what is right, red with a cause and a command for what is not, and the same report
//! whatever the number of jobs and parts.

use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use flotor_tests::{TestSize, workspace_root};
use quick_xml::Reader;
use quick_xml::events::Event;
use rustix::process::Signal;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

fn test(folder: &Path, arguments: &[&str]) -> Ran {
    Flotor::with(["test"].iter().chain(arguments)).inside(folder).run()
}

/// A folder with a scene of the model that fails on request, and what is expected of it.
fn faulty(expectations: &str) -> Scratch {
    let scratch = Scratch::default();
    let model = plugin_file("fixture-faulty-model");
    let scene = format!(
        "duration_s = 0.2\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = {model:?}\nname = \"faulty\"\n"
    );
    let _ = scratch.file("scene.toml", scene);
    let _ = scratch.file("faulty.test.toml", format!("scene = \"scene.toml\"\n{expectations}"));
    scratch
}

const WITH_A_CRASH: &str = "[set]\nfaulty.fault = [\"none\", \"aborts\", \"nan\"]\nfaulty.at_tick = [50]\n\
    device.hand_stiffness_n_per_m = [1900]\n[expect]\nlate_ticks = 0\n\"plugins.faulty.health\" = \"ok\"\n";

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.stdout).unwrap_or_else(|error| panic!("{error}: {ran:#?}"))
}

// ---------------------------------------------------------------- what is right

#[test]
fn in_the_root_of_the_repository_all_its_tests_pass() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let ran = test(&workspace_root(), &[]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    for case in ["host/scenes/demo: validate", "examples/ci/floor: validate"] {
        assert!(
            ran.stdout.lines().any(|line| line.starts_with("ok ") && line.ends_with(case)),
            "{}",
            ran.stdout
        );
    }
}

/// Makes the generator's model in C, with changes of its source, and builds it as its author is told.
fn made(scratch: &Scratch, changes: &[(&str, &str)]) -> PathBuf {
    let ran = Flotor::with(["new", "model", "jelly", "--language", "c"]).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stdout.contains("flotor test jelly.test.toml"), "{}", ran.stdout);
    let folder = scratch.path().join("jelly");
    let mut source = std::fs::read_to_string(folder.join("plugin.c")).expect("it was made");
    for (from, to) in changes {
        assert!(source.contains(from), "the template has no {from}");
        source = source.replace(from, to);
    }
    std::fs::write(folder.join("plugin.c"), source).expect("a scratch folder can be written to");
    let told = ran.stdout.lines().map(str::trim).find(|line| line.starts_with("cc ")).expect("it says how");
    let built = Command::new("sh").args(["-c", told]).current_dir(&folder).status().expect("sh starts");
    assert!(built.success(), "{told}");
    folder
}

#[test]
fn the_model_of_the_generator_passes_and_has_a_workflow() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    if !required(Tool::Cc) {
        return;
    }
    let scratch = Scratch::default();
    let folder = made(&scratch, &[]);
    let ran = test(&folder, &["jelly.test.toml", "--junit", "results.xml"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(junit(&folder.join("results.xml")), (4, 0), "each of the cases differs");
    let workflow =
        std::fs::read_to_string(folder.join(".github/workflows/haptics.yml")).expect("it was made");
    assert!(workflow.contains("flotor test jelly.test.toml --junit results.xml"), "{workflow}");
    assert!(!workflow.contains(scratch.path().to_str().expect("a plain name")), "no path of this machine");
}

// ---------------------------------------------------------------- what is not

#[test]
fn a_replay_that_starts_near_a_failure_fails_with_the_same_error() {
    let scratch = Scratch::default();
    let library = plugin_file("fixture-faulty-model");
    let beside = Path::new(&library).file_name().and_then(|name| name.to_str()).expect("it has a name");
    std::fs::copy(&library, scratch.path().join(beside)).expect("a scratch folder can be written to");
    let scene = "duration_s = 0.2\n[device]\nplugin = \"simulated\"\n[[model]]\nname = \"faulty\"\n";
    let _ = scratch.file("scene.toml", format!("{scene}plugin = \"./{beside}\"\n"));
    let set = "set.faulty.fault = [\"panics-in-step\"]\nset.faulty.at_tick = [50]\n";
    let expect = "[expect]\n\"plugins.faulty.health\" = \"ok\"\n";
    let _ = scratch.file("faulty.test.toml", format!("scene = \"scene.toml\"\n{set}{expect}"));
    // The second run finds the files of the first.
    for _ in 0..2 {
        let ran = test(scratch.path(), &["faulty.test.toml", "--plots", "pictures"]);
        assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
        let near = ran.stdout.lines().find_map(|line| line.trim().strip_prefix("$ flotor replay "));
        let words: Vec<&str> = near.unwrap_or_else(|| panic!("{ran:#?}")).split(' ').collect();
        assert!(words.contains(&"--from-state"), "{words:?}");
        let again = Flotor::with(["replay"].iter().chain(&words)).inside(scratch.path()).run();
        assert!(again.stderr.contains("step gave up at tick 50"), "{again:#?}");
    }
}

#[test]
fn a_defect_of_the_model_is_found_with_its_cause_and_a_picture() {
    if !required(Tool::Cc) {
        return;
    }
    const FORCE: &str = "output->wrench.force_n[2] = values[STIFFNESS] * depth_m;";
    for (name, from, to, case, says) in [
        ("sign", FORCE, "output->wrench.force_n[2] = -values[STIFFNESS] * depth_m;", "curve", "fz_n at z_m"),
        ("default", ".default_ = 500.0", ".default_ = 505.0", "curve", "got 2.02"),
        (
            "step",
            FORCE,
            "output->wrench.force_n[2] = values[STIFFNESS] * depth_m + (input->pose.position_m[0] > 0.001);",
            "stress",
            "M1 continuity",
        ),
        (
            "allocation",
            FORCE,
            "void *volatile lost = malloc(64); free(lost); output->wrench.force_n[2] = values[STIFFNESS] * depth_m;",
            "validate",
            "rule no-system-calls",
        ),
        (
            "nan",
            FORCE,
            "output->wrench.force_n[2] = depth_m > 0.001 && depth_m < 0.0015 ? NAN : values[STIFFNESS] * depth_m;",
            "seed 1",
            "results were not finite",
        ),
    ] {
        let scratch = Scratch::default();
        let folder = made(&scratch, &[(from, to)]);
        let ran = test(&folder, &["jelly.test.toml", "--filter", case, "--plots", "pictures"]);
        assert_eq!(ran.code, Some(exit_code::OTHER), "{name}: {ran:#?}");
        assert!(ran.stdout.contains(says), "{name}: {}", ran.stdout);
        assert!(ran.stdout.contains(&format!("FAILED  jelly: {case}\n")), "{name}: {}", ran.stdout);
        let pictures = std::fs::read_dir(folder.join("pictures")).expect("the folder was made");
        let pictures: Vec<PathBuf> = pictures.map(|file| file.expect("it can be read").path()).collect();
        // No curve of a run shows a violated rule.
        assert_eq!(pictures.len(), usize::from(case != "validate"), "{name}");
        let Some(picture) = pictures.first() else { continue };
        let picture = std::fs::read_to_string(picture).expect("it is text");
        for (of, shown) in [
            ("curve", "expected"),
            ("curve", "Force, z (N) against z (mm)"),
            ("seed 1", "model fault"),
            ("stress", "M1: largest change over a piece"),
        ] {
            assert!(of != case || picture.contains(shown), "{name}: no {shown} in the picture of {case}");
        }
    }
}

#[test]
fn a_newcomer_has_a_green_run_in_ten_commands_and_a_red_one_after_each_mistake() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let (scratch, script) = (Scratch::default(), workspace_root().join("tests/newcomer"));
    let folder = scratch.path().join("newcomer");
    let ran = Flotor::with([script.as_os_str(), folder.as_os_str(), "installed".as_ref()])
        .through_shell("unset CARGO_TARGET_DIR; PATH=\"${1%/*}:$PATH\" exec bash \"$2\" \"$3\" \"$4\"")
        .env("CARGO_NET_OFFLINE", "true")
        // The model is the same; its dependencies compile in a third of the time.
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
        .run();
    assert_eq!(ran.code, Some(0), "{}{}", ran.stdout, ran.stderr);
    assert!(ran.stdout.ends_with("green, and red four times\n"), "{}", ran.stdout);
}

#[test]
fn a_plugin_that_crashes_fails_its_case_alone_and_the_command_repeats_it() {
    let scratch = faulty(WITH_A_CRASH);
    let ran = test(scratch.path(), &["--json", "-"]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    let report = json(&ran);
    assert_eq!((&report["passed"], &report["failed"]), (&Value::from(1), &Value::from(2)), "{report:#}");
    let case = |fault: &str| {
        let cases = report["cases"].as_array().expect("cases");
        let named = |case: &&Value| case["case"].as_str().is_some_and(|name| name.contains(fault));
        cases.iter().find(named).unwrap_or_else(|| panic!("{report:#}"))
    };
    assert_eq!(case("fault=none")["passed"], true);
    // As far as tick 50, in which it crashes, with the settings of the case.
    let detail = case("fault=aborts")["detail"].as_str().expect("a command");
    assert!(
        detail.contains(" --set faulty.fault=aborts ") && detail.ends_with("--duration 0.051s"),
        "{detail}"
    );
    assert!(detail.contains("hand_stiffness"), "{detail}");
    let words: Vec<&str> = detail.split(' ').skip(1).collect();
    let again = Flotor::with(&words).inside(scratch.path()).run();
    assert_eq!(again.code, Some(exit_code::PLUGIN_REFUSED), "{detail}: {again:#?}");
}

/// Two cases miss one bound by different numbers: each command fails as its case did.
#[test]
fn the_printed_command_judges_and_fails_as_the_case_did() {
    let scratch = faulty(
        "seeds = [1, 11]\n[set]\ndevice.hand_stiffness_n_per_m = [300, 900]\n[expect]\npeak_force_n = 0\n",
    );
    let text = std::fs::read_to_string(scratch.path().join("scene.toml")).expect("it was written");
    let _ = scratch.file("scene.toml", text + "[[model]]\nplugin = \"spring\"\n");
    let report = json(&test(scratch.path(), &["--json", "-"]));
    let cases = report["cases"].as_array().expect("cases");
    assert_eq!((cases.len(), &report["failed"]), (4, &Value::from(4)), "{report:#}");
    let got = |case: &Value| case["failures"][0]["got"].as_str().expect("a number").to_owned();
    assert_ne!(got(&cases[0]), got(&cases[2]), "the settings matter");
    for case in cases {
        assert_eq!(case.get("detail"), None, "a peak belongs to the whole run: {case:#}");
        let repeat = case["repeat"].as_str().expect("a command");
        let again = Flotor::with([format!("{repeat} --json -")])
            .through_shell("program=$1; flotor() { \"$program\" \"$@\"; }; eval \"$2\"")
            .inside(scratch.path())
            .run();
        assert_eq!(again.code, Some(exit_code::OTHER), "{repeat}: {again:#?}");
        assert_eq!(json(&again)["cases"], Value::from(vec![case.clone()]), "{repeat}");
    }
}

#[test]
fn pictures_of_an_earlier_call_are_removed() {
    let scratch = faulty("seeds = [1, 2]\n[expect]\npeak_force_n = { min = 1 }\n");
    let pictures = scratch.path().join("pictures");
    let names = || {
        let files = std::fs::read_dir(&pictures).expect("the folder was made").flatten();
        files.map(|file| file.file_name().to_string_lossy().into_owned()).collect::<Vec<_>>().len()
    };
    let _ = test(scratch.path(), &["--plots", "pictures"]);
    assert_eq!(names(), 2);
    std::fs::write(pictures.join("mine.svg"), "mine").expect("the folder is ours");
    let _ = test(scratch.path(), &["--plots", "pictures", "--filter", "faulty: seed 1"]);
    assert_eq!(names(), 2, "that of one case, and a file that no case has");
}

#[test]
fn what_bless_cannot_change_is_named() {
    let scratch = faulty("[expect]\npeak_force_n = { min = 1 }\n");
    let ran = test(scratch.path(), &["--bless"]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(
        ran.stderr.contains("note: faulty: seed 1: peak_force_n: expected at least 1, got 0"),
        "{ran:#?}"
    );
    assert!(ran.stderr.contains("not blessed"), "{ran:#?}");
}

#[test]
fn a_failing_run_is_shortened_to_the_first_tick_that_fails() {
    let scratch = faulty("[expect]\n\"plugins.faulty.health\" = \"ok\"\nend = \"finished\"\n");
    let text = std::fs::read_to_string(scratch.path().join("scene.toml")).expect("it was written");
    let _ = scratch.file("scene.toml", text + "[model.parameters]\nfault = \"nan-once\"\nat_tick = 50\n");
    let ran = test(scratch.path(), &[]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.stdout.contains("--duration 0.051s"), "{}", ran.stdout);
}

#[test]
fn what_is_wrong_in_a_file_is_told_before_anything_runs() {
    for (expectations, says) in [
        ("[expect]\npeak_force = 1\n", "faulty.test.toml:3: a run has no number `peak_force`; did you mean"),
        ("[expect]\npeak_force_n = \"big\"\n", "faulty.test.toml:3: `peak_force_n` is"),
        ("[set]\nfaulty.falt = [1]\n[expect]\nend = \"finished\"\n", "did you mean `fault`?"),
        ("[set]\nfaulty.fault = [\"none\", \"odd\"]\n[expect]\nend = \"finished\"\n", "faulty.test.toml: "),
        ("[expct]\nend = \"finished\"\n", "faulty.test.toml:2: unknown key `expct`; did you mean `expect`?"),
    ] {
        let scratch = faulty(expectations);
        let ran = test(scratch.path(), &["--junit", "results.xml"]);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains(says), "{ran:#?}");
        assert!(!scratch.path().join("results.xml").exists());
    }
    let ran = test(Scratch::default().path(), &[]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "no test is no success: {ran:#?}");
    let ran = test(faulty(WITH_A_CRASH).path(), &["--filter", "nothing"]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
}

#[test]
fn a_reference_and_a_golden_recording_are_compared_within_a_tolerance() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    for (fault, code) in [("none", exit_code::OK), ("pumps", exit_code::OTHER)] {
        let scratch = faulty(
            "[expect]\nend = \"finished\"\n[golden]\nrecording = \"golden.mcap\"\nwithin_n = 1e-9\n\
             [reference]\nset = { faulty.fault = \"none\" }\nwithin = { peak_force_n = 1e-6 }\n",
        );
        let record = ["run", "scene.toml", "--clock", "virtual", "--seed", "1", "--record", "golden.mcap"];
        let fault = format!("faulty.fault={fault}");
        let record = Flotor::with(record.into_iter().chain(["--set", &fault])).inside(scratch.path()).run();
        assert_eq!(record.code, Some(exit_code::OK), "{record:#?}");
        let text = std::fs::read_to_string(scratch.path().join("scene.toml")).expect("it was written");
        let word = fault.rsplit('=').next().unwrap_or_default();
        let _ = scratch.file("scene.toml", format!("{text}[model.parameters]\nfault = \"{word}\"\n"));
        let ran = test(scratch.path(), &["--filter", "seed"]);
        assert_eq!(ran.code, Some(code), "{ran:#?}");
        assert!(code == 0 || ran.stdout.contains("peak_force_n against the reference"), "{}", ran.stdout);
        let ran = test(scratch.path(), &["--filter", "golden"]);
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    }
}

#[test]
fn a_stress_test_holds_the_model_to_what_counts_and_repeats_what_failed() {
    let scratch = Scratch::default();
    let model = plugin_file("fixture-defective-model");
    let scene =
        format!("duration_s = 0.1\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = {model:?}\n");
    let _ = scratch.file("scene.toml", scene);
    let step = |pass: &str| {
        format!(
            "scene = \"scene.toml\"\n[stress]\nsize = \"short\"\npass = [{pass}]\nset = {{ defect = \"force-step\" }}\n"
        )
    };
    // A step of the force at one plane: the search finds it, and the same poses give the same bits.
    let _ = scratch.file("model.test.toml", step("\"M8\""));
    let ran = test(scratch.path(), &[]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let _ = scratch.file("model.test.toml", step("\"M8\", \"M9\""));
    let ran = test(scratch.path(), &["--json", "-"]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    let report = json(&ran);
    let failures = report["cases"][0]["failures"].as_array().expect("failures");
    assert_eq!(failures.len(), 1, "{report:#}");
    assert_eq!(failures[0]["what"], "M9 search");
    let detail = report["cases"][0]["detail"].as_str().expect("a command");
    assert!(detail.ends_with("--size short --set defect=force-step --only M9"), "{detail}");
}

// ---------------------------------------------------------------- reports

/// Numbers of cases and of failures, by a parser of XML that knows nothing of us.
fn junit(file: &Path) -> (usize, usize) {
    let text = std::fs::read_to_string(file).expect("the results were written");
    let mut reader = Reader::from_str(&text);
    let (mut cases, mut failures, mut announced) = (0, 0, Vec::new());
    loop {
        match reader.read_event().unwrap_or_else(|error| panic!("{error}: {text}")) {
            Event::Start(element) | Event::Empty(element) => {
                let totals = ["tests", "failures"].map(|name| {
                    let total =
                        element.try_get_attribute(name).unwrap_or_else(|error| panic!("{error}: {text}"));
                    total.map(|total| {
                        String::from_utf8_lossy(&total.value).parse::<usize>().expect("a number")
                    })
                });
                announced.extend(totals[0].zip(totals[1]));
                for attribute in element.attributes() {
                    assert!(!attribute.unwrap_or_else(|error| panic!("{error}: {text}")).value.is_empty());
                }
                cases += usize::from(element.name().as_ref() == b"testcase");
                failures += usize::from(element.name().as_ref() == b"failure");
            }
            Event::Eof => {
                assert_eq!(announced, [(cases, failures); 2], "both totals are those of the cases");
                return (cases, failures);
            }
            _ => {}
        }
    }
}

#[test]
fn a_name_that_xml_has_to_escape_comes_back_as_it_was() {
    let (scratch, name) = (Scratch::default(), "a <b> & \"c\" 'd'\t");
    let _ = scratch.file(
        "scene.toml",
        "duration_s = 0.01\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"wall\"\n",
    );
    let _ =
        scratch.file(&format!("{name}.test.toml"), "scene = \"scene.toml\"\n[expect]\nend = \"finished\"\n");
    let ran = test(scratch.path(), &["--junit", "results.xml"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let file = scratch.path().join("results.xml");
    assert_eq!(junit(&file), (1, 0));
    let text = std::fs::read_to_string(file).expect("the results were written");
    let mut reader = Reader::from_str(&text);
    let class = std::iter::repeat_with(|| reader.read_event().expect("XML")).find_map(|event| match event {
        Event::Empty(case) => {
            let class = case.try_get_attribute("classname").expect("XML")?;
            let written = String::from_utf8_lossy(&class.value).into_owned();
            Some(quick_xml::escape::unescape(&written).expect("XML").into_owned())
        }
        _ => None,
    });
    // A control character has no place in XML.
    assert_eq!(class.as_deref(), Some(name.replace('\t', " ").as_str()));
}

#[test]
fn the_number_of_jobs_changes_nothing() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = faulty(WITH_A_CRASH);
    let report = |jobs: &str| {
        let ran = test(scratch.path(), &["--jobs", jobs, "--json", "-", "--junit", "results.xml"]);
        let xml = scratch.path().join("results.xml");
        assert_eq!(junit(&xml), (3, 2));
        let xml = std::fs::read_to_string(xml).expect("it was written");
        // A time is one of the machine.
        let timeless = xml.split(" time=\"").map(|part| part.split_once('"').map_or(part, |(_, rest)| rest));
        (ran.stdout, timeless.collect::<String>())
    };
    assert_eq!(report("1"), report("4"));
}

#[test]
fn the_order_of_the_files_changes_nothing() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = faulty(WITH_A_CRASH);
    let second = format!("scene = \"scene.toml\"\n{WITH_A_CRASH}").replace("[50]", "[60]");
    let _ = scratch.file("another.test.toml", second);
    let report = |paths: &[&str]| {
        let ran = test(scratch.path(), &[paths, &["--json", "-"]].concat());
        assert_eq!(json(&ran)["failed"], 4, "{ran:#?}");
        ran.stdout
    };
    let (one, other) = ("faulty.test.toml", "./another.test.toml");
    assert_eq!(report(&[one, other]), report(&[other, one]));
    assert_eq!(report(&[one, other]), report(&["."]), "found in a folder, in the order of its files");
}

#[test]
fn the_parts_add_up_to_the_whole() {
    let scratch = faulty(&format!("seeds = [1, 2, 3, 4, 5]\n{WITH_A_CRASH}"));
    let listed = |arguments: &[&str]| {
        let ran = test(scratch.path(), &[&["--list"], arguments].concat());
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
        ran.stdout.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let whole = listed(&[]);
    assert_eq!(whole.len(), 15);
    let parts: Vec<String> =
        ["1/3", "2/3", "3/3"].iter().flat_map(|part| listed(&["--shard", part])).collect();
    assert_eq!(parts.len(), whole.len());
    assert_eq!(parts.into_iter().collect::<BTreeSet<_>>(), whole.into_iter().collect());
}

#[test]
fn reports_of_parts_add_up_to_that_of_the_whole() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let scratch = faulty(&format!("seeds = [1, 2]\n{WITH_A_CRASH}"));
    let reported = |arguments: &[&str]| {
        let _ = test(scratch.path(), &[&["--junit", "results.xml"], arguments].concat());
        junit(&scratch.path().join("results.xml"))
    };
    let whole = reported(&[]);
    assert_eq!(whole, (6, 4));
    let parts = ["1/2", "2/2"].map(|part| reported(&["--shard", part]));
    assert!(parts.iter().all(|(cases, _)| *cases > 0), "{parts:?}");
    assert_eq!(parts.iter().fold((0, 0), |sum, part| (sum.0 + part.0, sum.1 + part.1)), whole);
}

#[test]
fn a_killed_test_leaves_no_report_not_even_an_old_one() {
    let scratch = faulty("duration = \"1000s\"\n[expect]\nend = \"finished\"\n");
    let results = scratch.file("results.xml", "<testsuites/>");
    let running =
        Flotor::with(["test", "--junit", "results.xml", "--jobs", "1"]).inside(scratch.path()).start();
    while results.exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    running.signal(Signal::KILL);
    assert_eq!(running.wait().code, None);
    assert!(!results.exists());
    // It starts anew.
    let _ = scratch.file("faulty.test.toml", "scene = \"scene.toml\"\n[expect]\nend = \"finished\"\n");
    let ran = test(scratch.path(), &["--junit", "results.xml"]);
    assert_eq!((ran.code, junit(&results)), (Some(exit_code::OK), (1, 0)), "{ran:#?}");
}

#[test]
fn a_pipe_for_a_report_is_written_to_and_not_replaced() {
    let scratch = faulty("[expect]\nlate_ticks = 0\n");
    let script = "mkfifo pipe && { cat pipe > read & } && \"$@\" && wait && test -p pipe";
    let ran = Flotor::with(["test", "--junit", "pipe"])
        .inside(scratch.path())
        .through_shell(script)
        .inside(scratch.path());
    let ran = ran.run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert_eq!(junit(&scratch.path().join("read")), (1, 0));
}

#[test]
fn blessing_changes_the_numbers_and_writes_digests_only_where_asked() {
    let scratch = faulty("[expect]\npeak_force_n = { value = 100.0, within = 0.001 } # of the hand\n");
    let text = || std::fs::read_to_string(scratch.path().join("faulty.test.toml")).expect("it is there");
    let ran = test(scratch.path(), &["--bless"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(ran.stdout.contains("faulty.test.toml:3: peak_force_n: 100 becomes "), "{}", ran.stdout);
    assert!(!text().contains("value = 100.0") && text().contains("# of the hand"), "{}", text());
    assert!(!text().contains("digests"), "{}", text());
    let ran = test(scratch.path(), &["--bless", "--digest"]);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    assert!(text().contains("[digests]\n\"seed 1\" = \"xxh3:"), "{}", text());
    assert_eq!(test(scratch.path(), &[]).code, Some(exit_code::OK));
    let _ = scratch.file("faulty.test.toml", text().replace("xxh3:", "xxh3:0"));
    let ran = test(scratch.path(), &[]);
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.stdout.contains("trace_digest: expected xxh3:0"), "{}", ran.stdout);
}
