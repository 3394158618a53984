//! A loop assembled in code, without a scene: a simulated flotor pressed onto a wall for a second of virtual time.
//!
//! `cargo run -p flotor-servo --example loop_without_scene`

use flotor_core::limits::{Boundary, Limits};
use flotor_core::mapping::{Blend, Mapping, MappingConfig};
use flotor_hal::{LoopConfig, SampledLoop};
use flotor_loader::Plugin;
use flotor_servo::{
    Engine, Envelope, Forces, Guarded, Layer, Loop, ParameterQueue, RunConfig, Schedule, Standby, StopSwitch,
    TimeBudget, swap_queues,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };

    // The device, opened and with its safety envelope.
    let mut device = Plugin::in_process(&flotor_simulated::FLOTOR_ENTRY)?.open_device(&[])?;
    let capabilities = device.capabilities()?;
    let envelope = Envelope::new(&Limits::default(), &Boundary::default(), &capabilities, config.period_ns);
    let device = Guarded { device, capabilities, envelope };

    let sampled =
        SampledLoop { period_s: config.period_ns as f64 * 1.0e-9, latency_s: capabilities.latency_s };

    // The force model, with its home at the home of the handle.
    let mut model = Plugin::in_process(&flotor_wall::FLOTOR_ENTRY)?.create_model(&[])?;
    model.prepare(&config)?;
    let instances = vec![(Engine::Here(model), Mapping::new(&MappingConfig::default()))];
    let layer = Layer::new(instances, &Blend::default(), TimeBudget::default(), &sampled);

    // No scheduled changes, and none during the run.
    let (parameters, _sender, _reports) = ParameterQueue::new(Vec::new(), 1);
    let (swaps, _host_swaps) = swap_queues(1, Vec::new());
    let forces = Forces::new(1, vec![(vec![0], layer)], Vec::new());
    let run = RunConfig {
        period_ns: config.period_ns,
        ramp_ns: 0,
        longest_gap_ns: 100_000_000,
        emergency_buttons: 0,
    };
    let standby = Standby::new(vec![device], forces, parameters, swaps, config, run);

    let stoppers = standby.stoppers();
    let names = vec!["device".to_owned(), "wall".to_owned()];
    let servo = standby.activate(names, |_| ()).map_err(|(_, refusal)| refusal)?;
    let mut looped = Loop::new(servo, Schedule::start_virtual(config.period_ns), 1_000_000_000);
    let mut peak_n = 0.0_f64;
    while looped.end().is_none() {
        looped
            .advance(&StopSwitch::default(), |record| peak_n = peak_n.max(record.commanded.force().length()));
    }
    stoppers.iter().for_each(flotor_loader::Stopper::safe_stop);
    println!("ended as {:?}; largest force on the hand {peak_n:.3} N", looped.end());
    Ok(())
}
