//! 3D view as a texture of the interface: drawn by a GPU or software adapter, or on the CPU for an interface without
//! adapter (tests).

use eframe::egui_wgpu::RenderState;
use egui::{ColorImage, Context, TextureHandle, TextureId, TextureOptions};
use flotor_drawing::geometry::Mesh;
use flotor_drawing::gpu::GpuScene;
use flotor_drawing::raster::{Rasterizer, View};

/// Renderer of the 3D view, with its last texture.
#[must_use]
pub enum Canvas {
    /// Rendering by the device of the interface.
    Gpu {
        /// Renderer.
        scene: Box<GpuScene>,
        /// Device of the interface.
        state: RenderState,
        /// Texture of the last frame and its size, pixels.
        shown: Option<(TextureId, [usize; 2])>,
    },
    /// Rendering by the processor.
    Cpu {
        /// Rasteriser.
        rasterizer: Rasterizer,
        /// Samples per pixel and direction.
        samples: usize,
        /// Texture of the last frame.
        texture: Option<TextureHandle>,
    },
}

impl Canvas {
    /// Creates a canvas on the device of the interface, or on the processor without a device.
    pub fn new(state: Option<&RenderState>) -> Self {
        /// Samples per pixel and direction, for interfaces without a waiting user (tests).
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

    /// Creates a canvas on the processor, with this many samples per pixel and direction.
    pub fn on_processor(samples: usize) -> Self {
        Self::Cpu { rasterizer: Rasterizer::default(), samples, texture: None }
    }

    /// Draws a mesh and returns the id of its texture, which the next call draws over.
    pub fn draw(&mut self, context: &Context, mesh: &Mesh, view: &View<'_>) -> TextureId {
        const FILTER: wgpu::FilterMode = wgpu::FilterMode::Nearest;
        match self {
            Self::Gpu { scene, state, shown } => {
                let (drawn, size) = (scene.draw(mesh, view), view.size);
                let (device, mut renderer) = (&state.device, state.renderer.write());
                let id = match *shown {
                    Some((id, shown)) if shown == size => id,
                    Some((id, _)) => {
                        renderer.update_egui_texture_from_wgpu_texture(device, drawn, FILTER, id);
                        id
                    }
                    None => renderer.register_native_texture(device, drawn, FILTER),
                };
                *shown = Some((id, size));
                id
            }
            Self::Cpu { rasterizer, samples, texture } => {
                let drawn = rasterizer.draw(mesh, view, *samples);
                let image = ColorImage::from_rgb(drawn.size, &drawn.rgb);
                let load = || context.load_texture("scene", image.clone(), TextureOptions::NEAREST);
                let texture = texture.get_or_insert_with(load);
                texture.set(image, TextureOptions::NEAREST);
                texture.id()
            }
        }
    }
}
