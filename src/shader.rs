//! The shader's source and the uniform block that goes with it. The layout is checked against the source by a test.

/// WGSL of the vertex and fragment stages.
pub const SOURCE: &str = include_str!("render/shader.wgsl");

/// Lit by vertex normals from the file.
pub const FLAG_GIVEN_NORMALS: u32 = 1;
/// Vertices have texture coordinates and an image is bound.
pub const FLAG_IMAGE: u32 = 2;
/// Colour by the representative in the coarsest level.
pub const FLAG_REPRESENTATIVES: u32 = 4;

/// The uniform block, in the order of the shader's `View`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Uniforms {
    /// Columns of the matrix from model units to clip space.
    pub clip_from_world: [[f32; 4]; 4],
    /// Eye, model units; w unused.
    pub eye: [f32; 4],
    /// Red, green, blue, alpha of what has no colour of its own.
    pub base_color: [f32; 4],
    /// Vertices of the finer level, of the coarser, of the coarsest; texels a row.
    pub counts: [u32; 4],
    /// Flags; the rest unused.
    pub flags: [u32; 4],
    /// Fraction of the geomorph; cosine beyond which an edge is a crease; the rest unused.
    pub morph: [f32; 4],
}

impl Uniforms {
    /// Size of the block.
    pub const BYTES: usize = 144;

    /// The block as the GPU reads it.
    pub fn to_bytes(&self) -> Vec<u8> {
        let floats = self.clip_from_world.iter().flatten().chain(&self.eye).chain(&self.base_color);
        let mut bytes: Vec<u8> = floats.flat_map(|f| f.to_le_bytes()).collect();
        bytes.extend(self.counts.iter().chain(&self.flags).flat_map(|u| u.to_le_bytes()));
        bytes.extend(self.morph.iter().flat_map(|f| f.to_le_bytes()));
        bytes
    }
}

#[cfg(all(test, not(target_arch = "wasm32")))]
mod tests {
    use super::*;

    fn module() -> naga::Module {
        naga::front::wgsl::parse_str(SOURCE).expect("the shader parses")
    }

    #[test]
    fn the_shader_is_valid() {
        let (flags, capabilities) = (naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
        let checked = naga::valid::Validator::new(flags, capabilities).validate(&module());
        assert!(checked.is_ok(), "{checked:?}");
    }

    #[test]
    fn the_uniform_block_is_laid_out_as_the_shader_reads_it() {
        let module = module();
        let (_, view) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("View")).expect("a struct View");
        let naga::TypeInner::Struct { members, span } = &view.inner else { panic!("View is no struct") };
        let layout: Vec<_> = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
        let expected = [("clip_from_world", 0), ("eye", 64), ("base_color", 80), ("counts", 96), ("flags", 112), ("morph", 128)];
        assert_eq!(layout, expected.map(|(n, o)| (n.to_string(), o)));
        assert_eq!(*span as usize, Uniforms::BYTES);
        let marked = Uniforms { counts: [7, 0, 0, 0], morph: [0.5, 0.0, 0.0, 0.0], ..Default::default() }.to_bytes();
        assert_eq!(marked.len(), Uniforms::BYTES);
        assert_eq!((marked[96], &marked[128..132]), (7, &0.5f32.to_le_bytes()[..]));
    }
}
