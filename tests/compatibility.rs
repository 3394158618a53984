//! Plugins made for the first contract, with the header of then, in the host of now.
//!
//! `fixtures/contract_0_1` holds a force model and a device as an author wrote them against contract 0.1, and the header
//! they were written with. None of the three may ever be changed. What is new since then is extensions these plugins do not
//! know; they must not miss them. `fixtures/first-contract-model` and `-device` are their like in Rust, for the SDK: sources
//! of then that must build, load and answer as then.
//!
//! While the contract is a draft (major version 0) a new minor may refuse old plugins; then this test is where that is
//! noticed and said. From 1.0 on it must hold for good.

use flotor::session::RunEnd;
use flotor::trace::Events;
use flotor_hal::Wrench;
use flotor_hal::abi::{ABI_MAJOR, ABI_MINOR};
use flotor_tests::library::{compile_c_file, plugin_file};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{Watched, watch};
use flotor_tests::workspace_root;
use std::path::PathBuf;

/// Compiles a plugin of then. Its own folder comes first where the compiler looks for the header.
fn compiled(scratch: &Scratch, name: &str) -> PathBuf {
    let source = workspace_root().join("tests/fixtures/contract_0_1").join(name).with_extension("c");
    let library = scratch.path().join(format!("lib{name}.so"));
    compile_c_file(&source, &[], &library);
    library
}

#[test]
fn the_contract_of_then_is_still_spoken() {
    assert_eq!(
        (ABI_MAJOR, ABI_MINOR),
        (0, 1),
        "a new contract refuses plugins of 0.1: say so in CHANGELOG under ABI, keep this folder as it is, and freeze the \
         new header and two plugins in a folder of its own"
    );
}

#[test]
fn plugins_of_the_first_contract_run_a_scene_today() {
    let scratch = Scratch::default();
    let (post, wall) = (compiled(&scratch, "post"), compiled(&scratch, "wall"));
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
    for name in ["wall", "post"] {
        let library = compiled(&scratch, name);
        let ran = Flotor::with(["validate".as_ref(), library.as_os_str()]).run();
        assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{name}: {ran:#?}");
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
