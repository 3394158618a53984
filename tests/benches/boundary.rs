//! What a call through the plugin boundary costs, the whole SDK path, next to a plain function pointer.
//!
//! `cargo bench -p flotor-tests --features measurements --bench boundary`. Prints the ratio of the two, measured in turns in one run, and
//! fails above 1.3: absolute times are the machine's, the ratio is ours.

use criterion::{Criterion, criterion_group};
use fixture_yardstick_model::{Yardstick, wrench};
use flotor_hal::abi::CallStatus;
use flotor_hal::{Input, Output, Pose};
use flotor_loader::Model;
use flotor_session::registry::load_file;
use flotor_tests::library::plugin_file;
use std::hint::black_box;
use std::time::Instant;

/// Most the boundary may cost, in plain calls.
const MOST: f64 = 1.3;
/// Calls in one measurement, and measurements in turns.
const CALLS: u32 = 20_000;
const TURNS: usize = 501;

type PlainFn = fn(&Yardstick, &Input, &mut Output);

fn model() -> Model {
    let plugin = load_file(&plugin_file("fixture-yardstick-model")).expect("the yardstick loads");
    plugin.create_model(&[]).expect("the yardstick needs no settings")
}

fn input() -> Input {
    let mut input = Input::at_rest(Pose::HOME);
    input.pose.position_m = [0.001, -0.002, 0.003];
    input.twist.linear_m_per_s = [0.1, 0.2, -0.3];
    input
}

fn boundary(criterion: &mut Criterion) {
    let (mut model, input, mut output) = (model(), input(), Output::default());
    let plain: PlainFn = black_box(wrench);
    let mut group = criterion.benchmark_group("one step");
    group.bench_function("plain function pointer", |bencher| {
        bencher.iter(|| plain(black_box(&Yardstick::DEFAULT), black_box(&input), black_box(&mut output)));
    });
    group.bench_function("plugin, whole SDK path", |bencher| {
        bencher.iter(|| model.step(black_box(&input), black_box(&mut output)));
    });
    group.finish();
}

/// Median ratio of plugin to plain call over many short measurements in turns, so that neighbours hit both.
fn ratio() -> f64 {
    let (mut model, input, mut output) = (model(), input(), Output::default());
    let plain: PlainFn = black_box(wrench);
    let mut ratios: Vec<f64> = (0..TURNS)
        .map(|_| {
            let started = Instant::now();
            for _ in 0..CALLS {
                plain(black_box(&Yardstick::DEFAULT), black_box(&input), black_box(&mut output));
            }
            let plain_s = started.elapsed().as_secs_f64();
            let started = Instant::now();
            for _ in 0..CALLS {
                assert_eq!(model.step(black_box(&input), black_box(&mut output)), CallStatus::Ok);
            }
            started.elapsed().as_secs_f64() / plain_s
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios[TURNS / 2]
}

criterion_group!(benches, boundary);

fn main() {
    benches();
    // `cargo test --benches` only wants to know that it runs.
    if std::env::args().any(|argument| argument == "--bench") {
        let ratio = ratio();
        println!("plugin call / plain function pointer: {ratio:.2} (at most {MOST})");
        assert!(ratio <= MOST, "the boundary costs {ratio:.2} plain calls");
    }
    Criterion::default().configure_from_args().final_summary();
}
