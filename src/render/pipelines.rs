//! Pipelines, the bind group layout that all meshes share, and the stand-ins for what a mesh lacks.

use super::targets::DEPTH_FORMAT;
use crate::shader::Uniforms;

/// The shader, parsed by the build script.
const MODULE: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/shader.naga"));

pub(super) struct Pipelines {
    pub(super) faces: wgpu::RenderPipeline,
    pub(super) lines: wgpu::RenderPipeline,
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) sampler: wgpu::Sampler,
    /// One white pixel.
    pub(super) white: wgpu::TextureView,
}

impl Pipelines {
    pub(super) fn new(
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        format: wgpu::TextureFormat,
        samples: u32,
    ) -> Result<Self, postcard::Error> {
        let source = wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(postcard::from_bytes(MODULE)?));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let layout = bind_group_layout(device);
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = |vertex: &str, fragment: &str, topology| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState { topology, ..Default::default() },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH_FORMAT,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::LessEqual),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let faces = pipeline("vertex", "fragment", wgpu::PrimitiveTopology::TriangleList);
        let lines = pipeline("line_vertex", "line_fragment", wgpu::PrimitiveTopology::LineList);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            address_mode_u: wgpu::AddressMode::Repeat,
            address_mode_v: wgpu::AddressMode::Repeat,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        let white = super::image::white(device, queue);
        Ok(Self { faces, lines, layout, sampler, white })
    }
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry = |binding, visibility, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let texture = |sample_type| wgpu::BindingType::Texture {
        sample_type,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let both = wgpu::ShaderStages::VERTEX_FRAGMENT;
    let uniform = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: std::num::NonZeroU64::new(Uniforms::BYTES as u64),
    };
    let mut entries = vec![entry(0, both, uniform)];
    entries.extend((1..5).map(|b| entry(b, wgpu::ShaderStages::VERTEX, texture(wgpu::TextureSampleType::Uint))));
    let color = texture(wgpu::TextureSampleType::Float { filterable: true });
    entries.push(entry(5, wgpu::ShaderStages::FRAGMENT, color));
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    entries.push(entry(6, wgpu::ShaderStages::FRAGMENT, sampler));
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}
