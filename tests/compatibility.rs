//! Plugins made for earlier contracts, with the headers of then, in the host of now.
//!
//! `fixtures/contract_0_1` and `contract_1_0` hold a force model and a device as an author wrote them against that contract,
//! and the header they were written with. None of them may ever be changed. What is new since then is extensions these
//! plugins do not know; they must not miss them. `fixtures/first-contract-model` and `-device` are their like in Rust, for the
//! SDK: sources of then that must build, load and answer as then.
//!
//! A version of the contract that adds something gets a folder of its own here.

use flotor_core::trace::Events;
use flotor_hal::Wrench;
use flotor_hal::abi::{ABI_MAJOR, ABI_MINOR, is_spoken};
use flotor_servo::RunEnd;
use flotor_tests::library::{compile_c_file, plugin_file};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use flotor_tests::workspace_root;
use std::path::PathBuf;

/// Folders of the contracts that were, oldest first.
const CONTRACTS: [&str; 2] = ["contract_0_1", "contract_1_0"];

/// Compiles a plugin of then. Its own folder comes first where the compiler looks for the header.
fn compiled(scratch: &Scratch, contract: &str, name: &str) -> PathBuf {
    let source = workspace_root().join("tests/fixtures").join(contract).join(name).with_extension("c");
    let library = scratch.path().join(format!("lib{name}_{contract}.so"));
    compile_c_file(&source, &[], &library);
    library
}

#[test]
fn contracts_of_then_are_spoken_and_those_to_come_are_not() {
    for (major, minor) in [(0, 1), (1, 0), (ABI_MAJOR, ABI_MINOR)] {
        assert!(is_spoken(major, minor), "{major}.{minor}");
    }
    for (major, minor) in [(0, 0), (0, 2), (ABI_MAJOR, ABI_MINOR + 1), (ABI_MAJOR + 1, 0)] {
        assert!(!is_spoken(major, minor), "{major}.{minor}");
    }
}

#[test]
fn the_contract_of_today_is_kept() {
    assert_eq!(
        (ABI_MAJOR, ABI_MINOR),
        (1, 0),
        "say in CHANGELOG under ABI what is new, and keep the new header and two plugins in a folder of their own"
    );
}

#[test]
fn plugins_of_every_contract_run_a_scene_today() {
    CONTRACTS.into_iter().for_each(run_a_scene);
}

fn run_a_scene(contract: &str) {
    let scratch = Scratch::default();
    let (post, wall) = (compiled(&scratch, contract, "post"), compiled(&scratch, contract, "wall"));
    let Watched { records, outcome, .. } = watch(&format!(
        "duration_s = 0.02\n[device]\nplugin = {post:?}\n[[model]]\nplugin = {wall:?}\n\
         [model.parameters]\nstiffness_n_per_m = 700\n[limits]\nramp_s = 0\n"
    ));
    assert_eq!((outcome.end, records.len()), (RunEnd::Finished, 20));
    // A millimetre below home: 0.7 N up, delivered from the tick after the first.
    let expected = Wrench { force_n: [0.0, 0.0, 700.0 * 0.001], torque_nm: [0.0; 3] };
    for record in &records {
        assert_eq!((record.model, record.commanded, record.events), (expected, expected, Events::NONE));
        assert_eq!(record.delivered, if record.tick == 0 { Wrench::ZERO } else { expected });
    }
}

#[test]
fn they_violate_no_rule_of_today() {
    let scratch = Scratch::default();
    for (contract, name) in
        CONTRACTS.into_iter().flat_map(|contract| [(contract, "wall"), (contract, "post")])
    {
        let library = compiled(&scratch, contract, name);
        let ran = Flotor::with(["validate".as_ref(), library.as_os_str()]).run();
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{contract} {name}: {ran:#?}");
    }
}

#[test]
fn rust_sources_of_the_first_contract_build_and_answer_as_then() {
    let (post, floor) =
        (plugin_file("fixture-first-contract-device"), plugin_file("fixture-first-contract-model"));
    let Watched { records, outcome, .. } = watch(&format!(
        "duration_s = 0.02\n[device]\nplugin = {post:?}\n[[model]]\nplugin = {floor:?}\n\
         [model.parameters]\nstiffness_n_per_m = 400\n[limits]\nramp_s = 0\n"
    ));
    assert_eq!((outcome.end, records.len()), (RunEnd::Finished, 20));
    // A millimetre below home, and half of that remembered: 0.6 N up.
    let expected = Wrench { force_n: [0.0, 0.0, 400.0 * (0.001 + 0.5 * 0.001)], torque_nm: [0.0; 3] };
    for record in &records {
        assert_eq!((record.model, record.commanded, record.events), (expected, expected, Events::NONE));
    }
    for library in [post, floor] {
        let ran = Flotor::with(["validate".as_ref(), library.as_os_str()]).run();
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
    }
}
