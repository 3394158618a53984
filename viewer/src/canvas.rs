//! The 3D view as a texture of the interface: drawn by a GPU or software adapter, on the CPU where the interface has
//! neither (tests).

use crate::camera::Camera;
use crate::geometry::Mesh;
use crate::gpu::GpuScene;
use crate::raster::solid::{Backdrop, Rasterizer};
use eframe::egui_wgpu::RenderState;
use egui::{ColorImage, Context, TextureHandle, TextureId, TextureOptions};

/// What draws the 3D view, and what it has drawn last.
pub enum Canvas {
    /// A GPU or software adapter.
    Gpu(Box<GpuCanvas>),
    /// The processor.
    Cpu(Box<CpuCanvas>),
}

/// On the device the interface is drawn on.
pub struct GpuCanvas {
    scene: GpuScene,
    state: RenderState,
    shown: Option<(TextureId, [usize; 2])>,
}

/// On the processor.
#[derive(Default)]
pub struct CpuCanvas {
    rasterizer: Rasterizer,
    texture: Option<TextureHandle>,
}

impl Canvas {
    /// On the device of the interface, if it has one.
    #[must_use]
    pub fn new(state: Option<&RenderState>) -> Self {
        match state {
            Some(state) => Self::Gpu(Box::new(GpuCanvas {
                scene: GpuScene::new(&state.device, &state.queue),
                state: state.clone(),
                shown: None,
            })),
            None => Self::Cpu(Box::default()),
        }
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
        match self {
            Self::Gpu(canvas) => canvas.draw(mesh, camera, backdrop, size),
            Self::Cpu(canvas) => canvas.draw(context, mesh, camera, backdrop, size),
        }
    }
}

impl GpuCanvas {
    fn draw(&mut self, mesh: &Mesh, camera: &Camera, backdrop: Backdrop, size: [usize; 2]) -> TextureId {
        const FILTER: wgpu::FilterMode = wgpu::FilterMode::Nearest;
        let view = self.scene.draw(mesh, camera, backdrop, size);
        let device = &self.state.device;
        let id = match self.shown {
            Some((id, shown)) if shown == size => id,
            Some((id, _)) => {
                let mut renderer = self.state.renderer.write();
                renderer.update_egui_texture_from_wgpu_texture(device, view, FILTER, id);
                id
            }
            None => self.state.renderer.write().register_native_texture(device, view, FILTER),
        };
        self.shown = Some((id, size));
        id
    }
}

impl CpuCanvas {
    fn draw(
        &mut self,
        context: &Context,
        mesh: &Mesh,
        camera: &Camera,
        backdrop: Backdrop,
        size: [usize; 2],
    ) -> TextureId {
        /// Samples a pixel and direction: this is for interfaces that nobody waits for.
        const SAMPLES: usize = 2;
        let drawn = self.rasterizer.draw(mesh, camera, backdrop, size, SAMPLES);
        let image = ColorImage::from_rgb(drawn.size, &drawn.rgb);
        let load = || context.load_texture("scene", image.clone(), TextureOptions::NEAREST);
        let texture = self.texture.get_or_insert_with(load);
        texture.set(image, TextureOptions::NEAREST);
        texture.id()
    }
}
