//! Cost of a picture of a running host: the shape of the spring or of a solid of 5 000 triangles, its mesh, and six traces of ten
//! seconds.
//!
//! Measured is the processor time of the thread, not wall-clock time: the load of other programs does not count.

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{Criterion, criterion_group, criterion_main};
use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use flotor_core::mapping::{Blend, MappingConfig};
use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_drawing::camera::Camera;
use flotor_drawing::gpu::GpuScene;
use flotor_drawing::raster::View;
use flotor_hal::{Demand, Pose};
use flotor_history::quantity::Quantity;
use flotor_history::{History, Retention, unknown_run};
use flotor_record::{PluginDescription, Role, RunDescription};
use flotor_sync::Words;
use flotor_viewer::app::{Recorded, Start, Viewer};
use flotor_viewer::canvas::Canvas;
use flotor_viewer::palette::{Look, Palette};
use flotor_viewer::scene::{ArrowScale, Moment, SceneBuilder};
use flotor_viewer::shape::shapes_of;
use flotor_viewer::trace::Trace;
use std::hint::black_box;
use std::path::PathBuf;

/// Processor time of this thread, ns.
struct ProcessorTime;

fn used_ns() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1.0e9 + time.tv_nsec as f64
}

impl Measurement for ProcessorTime {
    type Intermediate = f64;
    type Value = f64;

    fn start(&self) -> f64 {
        used_ns()
    }

    fn end(&self, start: f64) -> f64 {
        used_ns() - start
    }

    fn add(&self, a: &f64, b: &f64) -> f64 {
        a + b
    }

    fn zero(&self) -> f64 {
        0.0
    }

    fn to_f64(&self, value: &f64) -> f64 {
        *value
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter() // ns as well
    }
}

const TICKS: u64 = 10_000;
const HEIGHT_PX: f64 = 448.0;
/// The 3D view in a window of 1280 x 800 with its panel.
const SCENE_PX: [usize; 2] = [980, 396];

fn run(model: &str) -> RunDescription {
    RunDescription {
        plugins: vec![PluginDescription {
            name: model.to_owned(),
            id: model.to_owned(),
            version: String::new(),
            file: String::new(),
            role: Role::Model(MappingConfig::default()),
            places_m: Vec::new(),
            shared_with: Vec::new(),
            blend: Blend::default(),
            field: None,
            latency_s: 0.0,
            at_hand: Demand::WRENCH,
            settings: Vec::new(),
            parameters: Vec::new(),
            device: 0,
        }],
        ..unknown_run()
    }
}

fn history() -> History {
    let mut history = History::new(run("spring"), Retention::All);
    (0..TICKS).for_each(|tick| history.push(&record(tick)));
    history
}

fn record(tick: u64) -> TickRecord {
    let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
    let phase = tick as f64 * 7.0e-3;
    record.tick = tick;
    record.time_ns = tick * 1_000_000;
    record.pose = Pose {
        position_m: [1.0e-3 * phase.cos(), 0.0, 2.0e-3 * phase.sin() - 2.0e-3],
        orientation_xyzw: [0.02 * phase.sin(), 0.0, 0.0, 1.0],
    };
    record.commanded.force_n = [phase.sin(), phase.cos(), 3.0 * phase.sin()];
    record
}

fn library(model: &str) -> PathBuf {
    let own = std::env::current_exe().expect("a bench is a program");
    let file = own.with_file_name(format!("libflotor_{model}.so"));
    assert!(file.is_file(), "{} is missing: run `cargo build --release` first", file.display());
    file
}

fn frame(criterion: &mut Criterion<ProcessorTime>) {
    let history = history();
    let (palette, scale) =
        (Palette::of(Look::Dark), history.samples().fold(ArrowScale::default(), ArrowScale::with));
    for model in ["spring", "solid", "membrane"] {
        let (mut shapes, missing) = shapes_of(&run(model), &[library(model)]);
        assert!(missing.is_empty() && shapes.len() == 1, "{missing:?}");
        let camera = Camera::experimenter(SceneBuilder::height_mm(&shapes));
        let mut builder = SceneBuilder::default();
        let mut moment_s = 0.0;
        criterion.bench_function(&format!("shape and mesh, {model}"), |bench| {
            bench.iter(|| {
                moment_s = (moment_s + 0.016) % 10.0;
                let sample = history.at(moment_s).expect("ten seconds");
                let (mesh, facts) = builder.build(
                    &mut shapes,
                    Moment::of(&[*sample]),
                    &palette,
                    &camera,
                    HEIGHT_PX,
                    scale,
                    true,
                );
                black_box((mesh.indices.len(), facts))
            });
        });
    }
    let (mut shapes, missing) = shapes_of(&two_devices(), &[library("solid")]);
    assert!(missing.is_empty() && shapes.len() == 1, "{missing:?}");
    let camera = Camera::fitting(SceneBuilder::extent(&shapes, 2), 1.6);
    let mut builder = SceneBuilder::default();
    let mut moment_s = 0.0;
    criterion.bench_function("shape and mesh, a solid and two devices", |bench| {
        bench.iter(|| {
            moment_s = (moment_s + 0.016) % 10.0;
            let sample = *history.at(moment_s).expect("ten seconds");
            let samples = [sample, sample];
            let (mesh, facts) =
                builder.build(&mut shapes, Moment::of(&samples), &palette, &camera, HEIGHT_PX, scale, true);
            black_box((mesh.indices.len(), facts))
        });
    });
    // As in a running host: 16 new ticks per picture.
    let mut coming = History::new(run("spring"), Retention::Newest(20_000));
    let mut ticks = (0..).map(record);
    ticks.by_ref().take(10_000).for_each(|record| coming.push(&record));
    let mut traces = [Trace::of(Quantity::Force), Trace::of(Quantity::Position)];
    criterion.bench_function("six traces of 10 s", |bench| {
        bench.iter(|| {
            ticks.by_ref().take(16).for_each(|record| coming.push(&record));
            let end_s = coming.span_s()[1];
            for trace in &mut traces {
                black_box(trace.points(&coming, [end_s - 10.0, end_s], 900, 1.0));
            }
        });
    });
}

/// Two devices, one of them on a solid of 4 900 triangles.
fn two_devices() -> RunDescription {
    let mut run = run("solid");
    let model = run.plugins[0].clone();
    let device = |number: u16| PluginDescription {
        name: ["left", "right"][usize::from(number)].to_owned(),
        id: "simulated".to_owned(),
        role: Role::Device,
        device: number,
        ..model.clone()
    };
    run.plugins = vec![device(0), device(1), model.clone()];
    run
}

/// Whole picture without rasterisation: interface, six traces of ten seconds, 3D scene, and egui's tessellation.
fn whole_picture(criterion: &mut Criterion<ProcessorTime>) {
    let context = egui::Context::default();
    let start = Start::Recording(Recorded {
        at_s: Some(0.0),
        ..Recorded::new(vec![history()], vec![library("spring")])
    });
    // Drawn by an adapter, on other threads; without an adapter, on this thread.
    let state =
        std::panic::catch_unwind(|| create_render_state(default_wgpu_setup(), Default::default())).ok();
    if state.is_none() {
        eprintln!("there is no adapter: the whole picture includes the 3D scene drawn on the processor");
    }
    let mut viewer = Viewer::new(&context, state.as_ref(), start, Look::Dark);
    // Usually done by a GPU, at the size that the scene has in this window; not part of the bound.
    let run = history();
    let (mut shapes, _) = shapes_of(run.run(), &[library("spring")]);
    let camera = Camera::experimenter(SceneBuilder::height_mm(&shapes));
    let (palette, scale) =
        (Palette::of(Look::Dark), run.samples().fold(ArrowScale::default(), ArrowScale::with));
    let sample = run.at(0.2).expect("ten seconds");
    let mut builder = SceneBuilder::default();
    let (mesh, _) = builder.build(
        &mut shapes,
        Moment::of(&[*sample]),
        &palette,
        &camera,
        SCENE_PX[1] as f64,
        scale,
        true,
    );
    let mut canvas = Canvas::new(None);
    criterion.bench_function("3D scene drawn on the processor", |bench| {
        let view = View { camera: &camera, backdrop: palette.backdrop, size: SCENE_PX };
        bench.iter(|| black_box(canvas.draw(&context, mesh, &view)));
    });

    let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(1280.0, 800.0));
    let mut time_s = 0.0;
    let mut picture = |viewer: &mut Viewer, events: Vec<egui::Event>| {
        time_s += 0.016;
        let input = egui::RawInput {
            screen_rect: Some(screen),
            time: Some(time_s),
            events,
            ..egui::RawInput::default()
        };
        let mut output = context.run_ui(input, |ui| viewer.show(ui));
        output.textures_delta.clear(); // nobody draws it
        context.tessellate(output.shapes, 1.0).len()
    };
    let space = |pressed| egui::Event::Key {
        key: egui::Key::Space,
        physical_key: None,
        pressed,
        repeat: false,
        modifiers: egui::Modifiers::NONE,
    };
    picture(&mut viewer, Vec::new());
    picture(&mut viewer, vec![space(true), space(false)]); // plays: every picture is another moment
    criterion.bench_function("whole picture at 1280x800", |bench| {
        bench.iter(|| black_box(picture(&mut viewer, Vec::new())));
    });
    let mut histories = History::of_each_device(&two_devices(), Retention::All);
    for record in (0..TICKS).map(record) {
        for (device, history) in (0..).zip(&mut histories) {
            history.push(&TickRecord { device, ..record });
        }
    }
    let start =
        Start::Recording(Recorded { at_s: Some(0.0), ..Recorded::new(histories, vec![library("solid")]) });
    let mut viewer = Viewer::new(&context, state.as_ref(), start, Look::Dark);
    picture(&mut viewer, Vec::new());
    picture(&mut viewer, vec![space(true), space(false)]);
    criterion.bench_function("whole picture of a solid and two devices", |bench| {
        bench.iter(|| black_box(picture(&mut viewer, Vec::new())));
    });
}

/// The 3D scene at the size of the window, drawn by an adapter: elapsed time until the adapter is done, not processor time.
fn scene_by_adapter(criterion: &mut Criterion) {
    let Ok(state) =
        std::panic::catch_unwind(|| create_render_state(default_wgpu_setup(), Default::default()))
    else {
        println!("skipped: there is no adapter that draws a 3D scene");
        return;
    };
    let info = state.adapter.get_info();
    let (history, palette) = (history(), Palette::of(Look::Dark));
    let (mut shapes, _) = shapes_of(history.run(), &[library("spring")]);
    let camera = Camera::experimenter(SceneBuilder::height_mm(&shapes));
    let scale = history.samples().fold(ArrowScale::default(), ArrowScale::with);
    let sample = *history.at(0.2).expect("ten seconds");
    let mut builder = SceneBuilder::default();
    let (mesh, _) =
        builder.build(&mut shapes, Moment::of(&[sample]), &palette, &camera, HEIGHT_PX, scale, true);
    let mut scene = GpuScene::new(&state.device, &state.queue);
    let view = View { camera: &camera, backdrop: palette.backdrop, size: [1280, 800] };
    criterion.bench_function(
        &format!("3D scene at 1280x800 drawn by {} ({})", info.name, info.backend),
        |bench| {
            bench.iter(|| {
                black_box(scene.draw(mesh, &view));
                state.device.poll(wgpu::PollType::wait_indefinitely()).expect("the adapter answers");
            });
        },
    );
}

criterion_group! {
    name = processor;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = frame, whole_picture
}
criterion_group!(adapter, scene_by_adapter);
criterion_main!(processor, adapter);
