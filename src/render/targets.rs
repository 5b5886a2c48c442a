//! The surface and the multisampled colour and depth targets, as large as the largest picture so far.

/// Owns what is drawn into.
pub(super) struct Targets {
    surface: wgpu::Surface<'static>,
    canvas: web_sys::OffscreenCanvas,
    format: wgpu::TextureFormat,
    samples: u32,
    size: (u32, u32),
    depth: Option<wgpu::TextureView>,
    color: Option<wgpu::TextureView>,
}

/// A picture on its way to the canvas.
pub(super) struct Frame {
    pub(super) texture: wgpu::SurfaceTexture,
    view: wgpu::TextureView,
}

pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth24Plus;

impl Targets {
    pub(super) fn new(
        surface: wgpu::Surface<'static>,
        format: wgpu::TextureFormat,
        samples: u32,
        canvas: web_sys::OffscreenCanvas,
    ) -> Self {
        Self { surface, canvas, format, samples, size: (0, 0), depth: None, color: None }
    }

    /// A frame that holds at least `size`.
    pub(super) fn frame(&mut self, device: &wgpu::Device, size: (u32, u32), limit: u32) -> Result<Frame, String> {
        let grown = (size.0.max(self.size.0).min(limit), size.1.max(self.size.1).min(limit));
        if grown != self.size {
            self.resize(device, grown);
        }
        use wgpu::CurrentSurfaceTexture as Current;
        match self.surface.get_current_texture() {
            Current::Success(texture) | Current::Suboptimal(texture) => {
                let view = texture.texture.create_view(&Default::default());
                Ok(Frame { texture, view })
            }
            _ => Err("the surface gives no texture".into()),
        }
    }

    fn resize(&mut self, device: &wgpu::Device, size: (u32, u32)) {
        self.canvas.set_width(size.0);
        self.canvas.set_height(size.1);
        self.surface.configure(
            device,
            &wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                format: self.format,
                color_space: Default::default(),
                width: size.0,
                height: size.1,
                present_mode: wgpu::PresentMode::AutoVsync,
                desired_maximum_frame_latency: 2,
                alpha_mode: wgpu::CompositeAlphaMode::Auto,
                view_formats: vec![],
            },
        );
        let target = |format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width: size.0, height: size.1, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: self.samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                // Any other usage of a multisampled target panics on this backend.
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        self.depth = Some(target(DEPTH_FORMAT));
        self.color = (self.samples > 1).then(|| target(self.format));
        self.size = size;
    }

    /// Clears and begins.
    pub(super) fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        frame: &Frame,
        clear: wgpu::Color,
    ) -> wgpu::RenderPass<'e> {
        let (view, resolve_target) = match &self.color {
            Some(color) => (color, Some(&frame.view)),
            None => (&frame.view, None),
        };
        let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: None,
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store },
            })],
            depth_stencil_attachment: self.depth.as_ref().map(|view| wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        })
    }
}
