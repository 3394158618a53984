//! Where pixels go: several samples each, made one, and read back when somebody wants them.

use super::pipeline::{COLOR, DEPTH, SAMPLES};
use crate::raster::solid::Image;
use std::sync::mpsc;
use std::time::Duration;
use wgpu::{
    CommandEncoder, Device, Extent3d, LoadOp, Operations, Queue, RenderPass, RenderPassColorAttachment,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, StoreOp, Texture, TextureDescriptor,
    TextureDimension, TextureFormat, TextureUsages, TextureView,
};

/// How long a picture may take to arrive: a software adapter on a loaded machine needs seconds.
const READ_WAIT: Duration = Duration::from_secs(20);

pub(super) struct Target {
    size: [u32; 2],
    samples: TextureView,
    depth: TextureView,
    texture: Texture,
    view: TextureView,
}

impl Target {
    pub(super) fn new(device: &Device, size: [u32; 2]) -> Self {
        let texture = |format: TextureFormat, sample_count: u32, usage: TextureUsages| {
            device.create_texture(&TextureDescriptor {
                label: None,
                size: extent(size),
                mip_level_count: 1,
                sample_count,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let view = |texture: &Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (samples, depth) = (
            texture(COLOR, SAMPLES, TextureUsages::empty()),
            texture(DEPTH, SAMPLES, TextureUsages::empty()),
        );
        let texture = texture(COLOR, 1, TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC);
        Self { size, samples: view(&samples), depth: view(&depth), view: view(&texture), texture }
    }

    pub(super) fn size(&self) -> [u32; 2] {
        self.size
    }

    pub(super) fn view(&self) -> &TextureView {
        &self.view
    }

    /// A pass over an empty picture.
    pub(super) fn begin<'a>(&self, encoder: &'a mut CommandEncoder) -> RenderPass<'a> {
        encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &self.samples,
                depth_slice: None,
                resolve_target: Some(&self.view),
                ops: Operations { load: LoadOp::Clear(wgpu::Color::BLACK), store: StoreOp::Discard },
            })],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(1.0), store: StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..RenderPassDescriptor::default()
        })
    }

    /// The pixels; `None` if the device is lost.
    pub(super) fn read(&self, device: &Device, queue: &Queue) -> Option<Image> {
        let [width, height] = self.size;
        // Rows of a copy begin at multiples of 256 bytes.
        let row_bytes = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(row_bytes) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            extent(self.size),
        );
        let submitted = queue.submit([encoder.finish()]);
        let (sender, receiver) = mpsc::channel();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            let _ = sender.send(result);
        });
        device
            .poll(wgpu::PollType::Wait { submission_index: Some(submitted), timeout: Some(READ_WAIT) })
            .ok()?;
        receiver.recv_timeout(READ_WAIT).ok()?.ok()?;
        let mapped = buffer.slice(..).get_mapped_range().ok()?;
        let rows = mapped.chunks_exact(row_bytes as usize);
        let pixels = rows.flat_map(|row| row.chunks_exact(4).take(width as usize));
        let rgb = pixels.flat_map(|pixel| pixel.iter().take(3).copied()).collect();
        Some(Image { size: self.size.map(|length| length as usize), rgb })
    }
}

fn extent([width, height]: [u32; 2]) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers: 1 }
}
