//! Renderer of the 3D view on a GPU or a software adapter, into a texture shared by window, tests and pictures.
//!
//! Reasons for a texture instead of egui's own pass: it has a depth buffer and multisampling regardless of the window,
//! works without a window, and its pixels can be read back.

mod pipeline;
mod target;

use crate::camera::Camera;
use crate::geometry::Mesh;
use crate::raster::{Backdrop, View};
use pipeline::{Pipelines, ViewUniform, pipelines};
use target::Target;
use wgpu::{BufferDescriptor, BufferUsages, Device, Queue, TextureView};

/// Renderer of scenes; buffers and textures are reused from frame to frame.
pub struct GpuScene {
    device: Device,
    queue: Queue,
    pipelines: Pipelines,
    view: wgpu::Buffer,
    binding: wgpu::BindGroup,
    vertices: Growing,
    indices: Growing,
    target: Option<Target>,
}

/// GPU buffer that grows to the next power of two of the required size.
struct Growing {
    buffer: wgpu::Buffer,
    usage: BufferUsages,
}

impl GpuScene {
    /// Creates a renderer on a device and compiles the shaders.
    #[must_use]
    pub fn new(device: &Device, queue: &Queue) -> Self {
        let pipelines = pipelines(device);
        let view = device.create_buffer(&BufferDescriptor {
            label: Some("view"),
            size: size_of::<ViewUniform>() as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let binding = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view"),
            layout: &pipelines.binding,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: view.as_entire_binding() }],
        });
        Self {
            device: device.clone(),
            queue: queue.clone(),
            pipelines,
            view,
            binding,
            vertices: Growing::new(device, BufferUsages::VERTEX),
            indices: Growing::new(device, BufferUsages::INDEX),
            target: None,
        }
    }

    /// Draws a mesh and returns its texture view: `Rgba8Unorm`, in gamma space, at most as large as the device permits. A change of
    /// size creates a new view.
    pub fn draw(&mut self, mesh: &Mesh, view: &View<'_>) -> &TextureView {
        let size = view.size.map(|length| u32::try_from(length.max(1)).unwrap_or(u32::MAX));
        let size = size.map(|length| length.min(self.device.limits().max_texture_dimension_2d));
        let fits = self.target.as_ref().is_some_and(|target| target.size == size);
        if !fits {
            self.target = None; // free the old texture first: both at once may exceed the memory
        }
        let target = self.target.get_or_insert_with(|| Target::new(&self.device, size));
        self.queue.write_buffer(
            &self.view,
            0,
            bytemuck::bytes_of(&uniform(view.camera, view.backdrop, size)),
        );
        self.vertices.write(&self.device, &self.queue, bytemuck::cast_slice(&mesh.vertices));
        self.indices.write(&self.device, &self.queue, bytemuck::cast_slice(&mesh.indices));

        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = target.begin(&mut encoder);
            pass.set_bind_group(0, &self.binding, &[]);
            pass.set_pipeline(&self.pipelines.backdrop);
            pass.draw(0..3, 0..1);
            pass.set_pipeline(&self.pipelines.solid);
            pass.set_vertex_buffer(0, self.vertices.buffer.slice(..));
            pass.set_index_buffer(self.indices.buffer.slice(..), wgpu::IndexFormat::Uint32);
            let count = u32::try_from(mesh.indices.len()).unwrap_or(u32::MAX);
            pass.draw_indexed(0..count, 0, 0..1);
        }
        self.queue.submit([encoder.finish()]);
        &target.view
    }
}

impl Growing {
    fn new(device: &Device, usage: BufferUsages) -> Self {
        /// Initial size, enough for an empty scene.
        const FIRST_BYTES: u64 = 1 << 16;
        Self { buffer: Self::buffer(device, usage, FIRST_BYTES), usage }
    }

    fn buffer(device: &Device, usage: BufferUsages, size: u64) -> wgpu::Buffer {
        let usage = usage | BufferUsages::COPY_DST;
        device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    }

    fn write(&mut self, device: &Device, queue: &Queue, bytes: &[u8]) {
        let size = bytes.len() as u64;
        if size > self.buffer.size() {
            self.buffer = Self::buffer(device, self.usage, size.next_power_of_two());
        }
        queue.write_buffer(&self.buffer, 0, bytes);
    }
}

#[allow(clippy::cast_possible_truncation)] // f32 is enough on a screen
fn uniform(camera: &Camera, backdrop: Backdrop, [width, height]: [u32; 2]) -> ViewUniform {
    let projection = camera.projection(f64::from(width) / f64::from(height)).as_mat4();
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255].map(|part| f32::from(part) / 255.0);
    let [x, y, z] = camera.eye_mm().as_vec3().to_array();
    ViewUniform {
        projection: projection.to_cols_array_2d(),
        eye_mm: [x, y, z, 1.0],
        top: opaque(backdrop.top),
        bottom: opaque(backdrop.bottom),
    }
}
