//! A mesh at one rate: positions on a grid and triangles, in one piece of an entropy coder's.

use crate::range::Coder;
use crate::refine::base::{BaseCoder, BaseTruth};
use crate::refine::item_limit;
use crate::refine::rows::Rows;
use pmesh_core::surface::NONE;

/// Vertices or triangles a byte that a decoder believes; some more of few bytes. Real meshes have one or two.
pub const ITEM_LIMIT: usize = 64;

/// A mesh as its coder numbers it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SingleMesh {
    /// Positions on the grid.
    pub rows: Vec<[i32; 3]>,
    /// Corners, by those.
    pub triangles: Vec<[u32; 3]>,
    /// Of an encoder: its own number of each.
    pub vertex_order: Vec<u32>,
}

/// Positions on a grid, and triangles between them.
type Parts<'a> = (&'a [[i32; 3]], &'a [[u32; 3]]);

/// Steps before the next look at whether the bytes are used up.
const STRIDE: usize = 256;

/// Codes a mesh of so many vertices and triangles; `truth` is what an encoder writes. `bytes` is how many a decoder has. O(n). Errors: a mesh that cannot be, or more than the bytes hold.
pub fn code_mesh<C: Coder>(
    coder: &mut C,
    (vertices, triangles, bytes): (u32, u32, usize),
    truth: Option<Parts>,
) -> Result<SingleMesh, &'static str> {
    if !C::ENCODES && u64::from(vertices.max(triangles)) > item_limit(bytes.min(u32::MAX as usize) as u32) {
        return Err("more of a mesh than so few bytes hold");
    }
    let rows_of = |rows: &[[i32; 3]]| Rows { width: 3, values: rows.as_flattened().to_vec(), ..Default::default() };
    let source = truth.map(|t| (rows_of(t.0), t.1, vec![NONE; t.0.len()]));
    let mut told = source.as_ref().map(|(rows, triangles, position_of)| BaseTruth::new(rows, triangles, position_of));
    let (mut base, mut rows) = (BaseCoder::new(vertices, triangles, 3), rows_of(&[]));
    while !base.step(coder, &mut rows, told.as_mut(), STRIDE)? {
        if coder.ran_out() {
            return Err("it ends before the mesh is whole");
        }
    }
    if rows.count() != vertices {
        return Err("a mesh of more vertices than it announces");
    }
    let rows = rows.values.chunks_exact(3).map(|r| [r[0], r[1], r[2]]).collect();
    Ok(SingleMesh { rows, triangles: base.triangles, vertex_order: told.map_or_else(Vec::new, |t| t.vertex_order) })
}
