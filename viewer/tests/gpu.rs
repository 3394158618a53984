//! A GPU or software adapter and the processor draw the same picture from the same scene.

use egui_kittest::wgpu::{create_render_state, default_wgpu_setup};
use flotor_hal::DVec3;
use flotor_viewer::camera::Camera;
use flotor_viewer::geometry::{Ground, Mesh, force_arrow, torque_arrow};
use flotor_viewer::gpu::GpuScene;
use flotor_viewer::palette::{Look, Palette};
use flotor_viewer::raster::solid::Rasterizer;

/// A scene with everything in it that the two could draw differently: faded lines, curved surfaces, edges, arrows.
fn scene(palette: &Palette) -> Mesh {
    let mut mesh = Mesh::default();
    let ground = Ground {
        height_m: -0.025,
        radius_m: 0.08,
        spacing_m: 0.005,
        surface: palette.ground[0],
        line: palette.ground[1],
    };
    ground.append(&mut mesh, &[]);
    force_arrow(&mut mesh, DVec3::new(0.0, 0.0, -0.02), DVec3::new(0.002, 0.0, 0.02), 0.001, palette.force);
    torque_arrow(&mut mesh, DVec3::new(0.0, 0.0, -0.012), DVec3::Z, 0.006, 4.0, 0.0008, palette.torque);
    mesh
}

#[test]
fn gpu_and_processor_draw_the_same_picture() {
    // Without any adapter the setup panics; that machine has nothing to compare.
    let state = std::panic::catch_unwind(|| create_render_state(default_wgpu_setup(), Default::default()));
    let Ok(state) = state else {
        assert!(std::env::var("FLOTOR_WINDOW_TESTS").is_err(), "there is no adapter");
        eprintln!("skipped: there is no adapter");
        return;
    };
    let mut gpu = GpuScene::new(&state.device, &state.queue);
    for look in [Look::Dark, Look::Light] {
        let palette = Palette::of(look);
        let (mesh, camera, size) = (scene(&palette), Camera::experimenter(25.0), [321, 200]);
        let _ = gpu.draw(&mesh, &camera, palette.backdrop, size);
        let drawn = gpu.read().expect("a picture comes back");
        let expected = Rasterizer::default().draw(&mesh, &camera, palette.backdrop, size, 4);
        assert_eq!(drawn.size, expected.size);
        let differences = || drawn.rgb.iter().zip(&expected.rgb).map(|(a, b)| f64::from(a.abs_diff(*b)));
        #[allow(clippy::cast_precision_loss)] // pixels
        let mean = differences().sum::<f64>() / drawn.rgb.len() as f64;
        let far = differences().filter(|difference| *difference > 40.0).count();
        // One lights corners, the other pixels; edges are smoothed with 4 and with 16 samples. A mirrored, shifted or
        // unlit picture differs by tens of levels all over.
        assert!(mean < 2.0, "{look:?}: {mean} levels on average");
        assert!(far < drawn.rgb.len() / 100, "{look:?}: {far} of {} far off", drawn.rgb.len());
    }
}
