//! A GPU or software adapter and the processor draw the same pictures: of a scene, and of the whole window.

mod support;

use eframe::egui_wgpu::RenderState;
use egui::{ColorImage, Context, Theme, vec2};
use egui_kittest::Harness;
use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use flotor_core::trace::Events;
use flotor_drawing::camera::Camera;
use flotor_drawing::gpu::GpuScene;
use flotor_drawing::raster::{Image, Rasterizer, View};
use flotor_hal::Pose;
use flotor_history::{History, Retention, Sample};
use flotor_viewer::app::{Recorded, Start, Viewer};
use flotor_viewer::palette::{Look, Palette};
use flotor_viewer::picture::{draw_without_window, write_png};
use flotor_viewer::scene::{ArrowScale, Moment, SceneBuilder};
use flotor_viewer::shape::shapes_of;
use std::time::Duration;
use support::tools::{Tool, lacks};
use support::{plugin_file, spring_run, tick};

/// An adapter; without any the setup panics, and that machine has nothing to compare.
fn adapter() -> Option<RenderState> {
    let state = std::panic::catch_unwind(|| create_render_state(default_wgpu_setup(), Default::default()));
    if state.is_err() {
        lacks(Tool::Adapter, "there is no adapter");
    }
    state.ok()
}

/// The pixels of a texture, three bytes each, row by row from the top.
fn read(state: &RenderState, texture: &wgpu::Texture) -> Image {
    let (device, size) = (&state.device, texture.size());
    // Rows of a copy begin at multiples of 256 bytes.
    let row_bytes = (4 * size.width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row_bytes) * u64::from(size.height),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
    let copy = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), copy, size);
    let submission_index = Some(state.queue.submit([encoder.finish()]));
    buffer.slice(..).map_async(wgpu::MapMode::Read, |result| result.expect("the buffer can be read"));
    // A software adapter on a loaded machine needs seconds.
    let timeout = Some(Duration::from_secs(20));
    device.poll(wgpu::PollType::Wait { submission_index, timeout }).expect("the picture arrives");
    let mapped = buffer.slice(..).get_mapped_range().expect("the buffer is mapped");
    let rows = mapped.chunks_exact(row_bytes as usize);
    let pixels = rows.flat_map(|row| row.chunks_exact(4).take(size.width as usize));
    let rgb = pixels.flat_map(|pixel| pixel.iter().take(3).copied()).collect();
    Image { size: [size.width as usize, size.height as usize], rgb }
}

/// Two pictures of one size, 8 bits a channel: mean difference, levels, and the part of all values that differ by more than 40.
fn difference(a: &[u8], b: &[u8]) -> (f64, f64) {
    assert_eq!(a.len(), b.len(), "one size");
    let differences = || a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(*b)));
    let part = |sum: f64| sum / a.len() as f64;
    let far = differences().filter(|difference| *difference > 40.0).count() as f64;
    (part(differences().sum()), part(far))
}

/// One lights corners, the other pixels; edges are smoothed with 4 and with 16 samples. A mirrored, shifted or unlit picture
/// differs by tens of levels all over.
const MEAN_LEVELS: f64 = 2.0;
/// Of a scene, which is edges all over, and of a window, most of which is text and lines of the same triangles.
const FAR_PART_OF_SCENE: f64 = 0.01;
const FAR_PART_OF_WINDOW: f64 = 0.002;

#[test]
fn an_adapter_and_the_processor_draw_the_same_scene() {
    let Some(state) = adapter() else { return };
    let mut gpu = GpuScene::new(&state.device, &state.queue);
    // A spring that is bent and shortened, arrows, ground, shadows: all that the two could draw differently.
    let mut record = tick(350, Events::NONE);
    let half = 0.1_f64;
    record.pose =
        Pose { position_m: [2.0e-3, -1.0e-3, -4.0e-3], orientation_xyzw: [half.sin(), 0.0, 0.0, half.cos()] };
    (record.commanded.force_n, record.commanded.torque_nm) = ([0.4, 0.2, 2.0], [0.0, 0.01, 0.02]);
    let sample = Sample::from(&record);
    let (mut shapes, missing) = shapes_of(&spring_run(&[]).0, &[plugin_file("spring")]);
    assert!(missing.is_empty() && shapes.len() == 1, "{missing:?}");
    for look in [Look::Dark, Look::Light] {
        let palette = Palette::of(look);
        let (camera, size) = (Camera::experimenter(SceneBuilder::height_mm(&shapes)), [641, 400]);
        let (mut builder, scale) = (SceneBuilder::default(), ArrowScale::default().with(&sample));
        let (mesh, _) =
            builder.build(&mut shapes, Moment::of(&[sample]), &palette, &camera, 400.0, scale, true);
        let view = View { camera: &camera, backdrop: palette.backdrop, size };
        let drawn = read(&state, gpu.draw(mesh, &view).texture());
        let expected = Rasterizer::default().draw(mesh, &view, 4);
        assert_eq!(drawn.size, expected.size);
        let (mean, far) = difference(&drawn.rgb, &expected.rgb);
        assert!(
            mean < MEAN_LEVELS && far < FAR_PART_OF_SCENE,
            "{look:?}: {mean} levels on average, {far} far off"
        );
    }
}

/// The window at a moment of a recording.
fn start(at_s: f64) -> Start {
    let mut history = History::new(spring_run(&[]).0, Retention::All);
    (0..3000).for_each(|number| history.push(&tick(number, Events::NONE)));
    Start::Recording(Recorded {
        at_s: Some(at_s),
        ..Recorded::new(vec![history], vec![plugin_file("spring")])
    })
}

fn by_processor(at_s: f64, look: Look) -> Vec<u8> {
    let mut viewer = Viewer::new(&Context::default(), None, start(at_s), look);
    let image = draw_without_window([1280, 800], 1.0, look, |ui| viewer.show(ui));
    image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect()
}

fn by_adapter(at_s: f64, look: Look) -> Vec<u8> {
    let theme = match look {
        Look::Dark => Theme::Dark,
        Look::Light => Theme::Light,
    };
    let builder = Harness::builder().with_size(vec2(1280.0, 800.0)).with_theme(theme).wgpu();
    let mut harness = builder.build_eframe(|creation| {
        assert!(creation.wgpu_render_state.is_some(), "the 3D view is drawn by the adapter as well");
        Viewer::new(&creation.egui_ctx, creation.wgpu_render_state.as_ref(), start(at_s), look)
    });
    harness.run_steps(4);
    let image = harness.render().expect("it is drawn");
    assert_eq!(image.dimensions(), (1280, 800));
    image.pixels().flat_map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect()
}

/// Keeps a picture for people to look at, where `FLOTOR_KEEP_PICTURES` names a folder.
fn keep(drawn_by: &str, look: Look, rgb: &[u8]) {
    let Some(folder) = std::env::var_os("FLOTOR_KEEP_PICTURES") else { return };
    let file = std::path::Path::new(&folder).join(format!("{drawn_by}-{look:?}.png"));
    write_png(&file, &ColorImage::from_rgb([1280, 800], rgb)).expect("the folder is there");
}

#[test]
fn an_adapter_and_the_processor_draw_the_same_window() {
    if adapter().is_none() {
        return;
    }
    for look in [Look::Dark, Look::Light] {
        let drawn = by_adapter(0.5, look);
        let expected = by_processor(0.5, look);
        keep("adapter", look, &drawn);
        keep("processor", look, &expected);
        let (mean, far) = difference(&drawn, &expected);
        assert!(
            mean < MEAN_LEVELS && far < FAR_PART_OF_WINDOW,
            "{look:?}: {mean} levels on average, {far} far off"
        );
        // That a difference would be seen: the spring half a second later, and the other look.
        let (_, later) = difference(&drawn, &by_processor(1.0, look));
        assert!(later > FAR_PART_OF_WINDOW, "{look:?}: another moment, and {later} far off");
        let (other, _) = difference(&drawn, &by_processor(0.5, look.other()));
        assert!(other > 20.0 * MEAN_LEVELS, "{look:?}: {other} levels to the other look");
    }
}
