//! The 3D view as a texture of the interface: drawn by a GPU or software adapter, on the CPU where the interface has
//! neither (tests).

use eframe::egui_wgpu::RenderState;
use egui::{ColorImage, Context, TextureHandle, TextureId, TextureOptions};
use flotor_drawing::camera::Camera;
use flotor_drawing::geometry::Mesh;
use flotor_drawing::gpu::GpuScene;
use flotor_drawing::raster::{Backdrop, Rasterizer};

/// What draws the 3D view, and what it has drawn last.
pub enum Canvas {
    /// On the device the interface is drawn on.
    Gpu {
        /// What draws.
        scene: Box<GpuScene>,
        /// The device.
        state: RenderState,
        /// The texture, and its size, pixels.
        shown: Option<(TextureId, [usize; 2])>,
    },
    /// On the processor.
    Cpu {
        /// What draws.
        rasterizer: Rasterizer,
        /// Samples a pixel and direction.
        samples: usize,
        /// The texture.
        texture: Option<TextureHandle>,
    },
}

impl Canvas {
    /// On the device of the interface, if it has one.
    #[must_use]
    pub fn new(state: Option<&RenderState>) -> Self {
        /// This is for interfaces that nobody waits for.
        const SAMPLES: usize = 2;
        match state {
            Some(state) => Self::Gpu {
                scene: Box::new(GpuScene::new(&state.device, &state.queue)),
                state: state.clone(),
                shown: None,
            },
            None => Self::on_processor(SAMPLES),
        }
    }

    /// On the processor, with so many samples a pixel and direction.
    #[must_use]
    pub fn on_processor(samples: usize) -> Self {
        Self::Cpu { rasterizer: Rasterizer::default(), samples, texture: None }
    }

    /// Draws a mesh.
    pub fn draw(
        &mut self,
        context: &Context,
        mesh: &Mesh,
        camera: &Camera,
        backdrop: Backdrop,
        size: [usize; 2],
    ) -> TextureId {
        const FILTER: wgpu::FilterMode = wgpu::FilterMode::Nearest;
        match self {
            Self::Gpu { scene, state, shown } => {
                let view = scene.draw(mesh, camera, backdrop, size);
                let (device, mut renderer) = (&state.device, state.renderer.write());
                let id = match *shown {
                    Some((id, shown)) if shown == size => id,
                    Some((id, _)) => {
                        renderer.update_egui_texture_from_wgpu_texture(device, view, FILTER, id);
                        id
                    }
                    None => renderer.register_native_texture(device, view, FILTER),
                };
                *shown = Some((id, size));
                id
            }
            Self::Cpu { rasterizer, samples, texture } => {
                let drawn = rasterizer.draw(mesh, camera, backdrop, size, *samples);
                let image = ColorImage::from_rgb(drawn.size, &drawn.rgb);
                let load = || context.load_texture("scene", image.clone(), TextureOptions::NEAREST);
                let texture = texture.get_or_insert_with(load);
                texture.set(image, TextureOptions::NEAREST);
                texture.id()
            }
        }
    }
}
