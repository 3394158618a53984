//! A tick with one active object, alone and among ten thousand that sleep. Prints both and their ratio.
//!
//! Both scenes run in turns, some thousands of ticks at a time; of each the median of the whole tick counts, so that a
//! neighbour on the machine hits both alike.

use flotor_core::trace::TickRecord;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use std::path::Path;

const ALONE: &str = "duration_s = 5\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
const INACTIVE: &str = "[[model]]\nplugin = \"wall\"\n[model.parameters]\nshape = \"sphere\"\nsize_mm = 1\n\
    [model.mapping]\nposition_mm = [0, 0, 100]\ngrid = { count = [20, 25, 20], spacing_mm = 3 }\n";
/// Runs of each scene.
const TURNS: usize = 15;

/// Whole ticks, ns.
#[derive(Default)]
struct Ticks(Vec<u64>);

impl Observer for Ticks {
    fn observe(&mut self, record: &TickRecord) {
        self.0.push(record.compute_ns);
    }
}

fn run(scene: &Scene, ticks: &mut Ticks) {
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(scene, &Registry::search(&[]), &options).expect("the scene starts");
    session.run(ticks, &StopSwitch::default()).expect("the scene runs");
}

fn median(ticks: &mut Ticks) -> f64 {
    ticks.0.sort_unstable();
    ticks.0[ticks.0.len() / 2] as f64
}

fn main() {
    let [alone, among] = [ALONE.to_owned(), format!("{ALONE}{INACTIVE}")]
        .map(|text| Scene::parse(Path::new("scene.toml"), &text).expect("the scene is right"));
    let (mut ticks_alone, mut ticks_among) = (Ticks::default(), Ticks::default());
    for _ in 0..TURNS {
        run(&alone, &mut ticks_alone);
        run(&among, &mut ticks_among);
    }
    let (alone_ns, among_ns) = (median(&mut ticks_alone), median(&mut ticks_among));
    println!("a tick with one active object        {alone_ns:.0} ns");
    println!("the same with 10 000 that sleep      {among_ns:.0} ns   {:.3} times", among_ns / alone_ns);
}
