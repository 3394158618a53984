//! Multisampled render target, resolved to a texture with one sample per pixel.

use super::pipeline::{COLOR, DEPTH, SAMPLES};
use wgpu::{
    CommandEncoder, Device, Extent3d, LoadOp, Operations, RenderPass, RenderPassColorAttachment,
    RenderPassDepthStencilAttachment, RenderPassDescriptor, StoreOp, Texture, TextureDescriptor,
    TextureDimension, TextureFormat, TextureUsages, TextureView,
};

pub(super) struct Target {
    pub(super) size: [u32; 2],
    samples: TextureView,
    depth: TextureView,
    pub(super) view: TextureView,
}

impl Target {
    pub(super) fn new(device: &Device, size: [u32; 2]) -> Self {
        let [width, height] = size;
        let texture = |format: TextureFormat, sample_count: u32, usage: TextureUsages| {
            device.create_texture(&TextureDescriptor {
                label: None,
                size: Extent3d { width, height, depth_or_array_layers: 1 },
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
        Self { size, samples: view(&samples), depth: view(&depth), view: view(&texture) }
    }

    /// Begins a render pass on a cleared picture.
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
}
