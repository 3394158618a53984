//! Render pipelines of the 3D view: backdrop and triangles.

use crate::geometry::Vertex;
use crate::light;
use bytemuck::{Pod, Zeroable};
use std::num::NonZeroU64;
use wgpu::{
    BindGroupLayout, BlendState, CompareFunction, DepthStencilState, Device, FragmentState, MultisampleState,
    PipelineLayout, PrimitiveState, RenderPipeline, RenderPipelineDescriptor, ShaderModule, ShaderStages,
    TextureFormat, VertexBufferLayout, VertexState, VertexStepMode,
};

/// Colour format, in gamma space like the blending of egui.
pub(super) const COLOR: TextureFormat = TextureFormat::Rgba8Unorm;
pub(super) const DEPTH: TextureFormat = TextureFormat::Depth32Float;
/// Samples per pixel: every adapter supports four.
pub(super) const SAMPLES: u32 = 4;

/// Uniform buffer of the shader, laid out as `View` in `scene.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct ViewUniform {
    pub(super) projection: [[f32; 4]; 4],
    pub(super) eye_mm: [f32; 4],
    pub(super) top: [f32; 4],
    pub(super) bottom: [f32; 4],
}

pub(super) struct Pipelines {
    pub(super) solid: RenderPipeline,
    pub(super) backdrop: RenderPipeline,
    pub(super) binding: BindGroupLayout,
}

pub(super) fn pipelines(device: &Device) -> Pipelines {
    let shader = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("scene"),
        source: wgpu::ShaderSource::Wgsl((light::wgsl_constants() + include_str!("scene.wgsl")).into()),
    });
    let binding = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("view"),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: NonZeroU64::new(size_of::<ViewUniform>() as u64),
            },
            count: None,
        }],
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("scene"),
        bind_group_layouts: &[Some(&binding)],
        immediate_size: 0,
    });
    let corners = VertexBufferLayout {
        array_stride: size_of::<Vertex>() as u64,
        step_mode: VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4],
    };
    // Surfaces write depth, and their back faces are culled.
    let solid = Stage { vertex: "place", fragment: "shade", buffers: &[Some(corners)], hides: true };
    let backdrop = Stage { vertex: "cover", fragment: "backdrop", buffers: &[], hides: false };
    let [solid, backdrop] = [solid, backdrop].map(|stage| stage.pipeline(device, &shader, &layout));
    Pipelines { solid, backdrop, binding }
}

struct Stage<'a> {
    vertex: &'a str,
    fragment: &'a str,
    buffers: &'a [Option<VertexBufferLayout<'a>>],
    hides: bool,
}

impl Stage<'_> {
    fn pipeline(&self, device: &Device, module: &ShaderModule, layout: &PipelineLayout) -> RenderPipeline {
        let compare = if self.hides { CompareFunction::Less } else { CompareFunction::Always };
        let target = wgpu::ColorTargetState {
            format: COLOR,
            blend: Some(BlendState::ALPHA_BLENDING),
            write_mask: wgpu::ColorWrites::ALL,
        };
        device.create_render_pipeline(&RenderPipelineDescriptor {
            label: Some(self.fragment),
            layout: Some(layout),
            vertex: VertexState {
                module,
                entry_point: Some(self.vertex),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: self.buffers,
            },
            primitive: PrimitiveState {
                cull_mode: self.hides.then_some(wgpu::Face::Back),
                ..PrimitiveState::default()
            },
            depth_stencil: Some(DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(self.hides),
                depth_compare: Some(compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: MultisampleState { count: SAMPLES, ..MultisampleState::default() },
            fragment: Some(FragmentState {
                module,
                entry_point: Some(self.fragment),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(target)],
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
