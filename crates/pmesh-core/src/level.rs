//! A level on its way in: what a codec makes of bytes and the mesh appends. Plain data; all checks are in `append`.

use crate::Vertices;

/// A batch of refinements, or a part of one ([`crate::ProgressiveMultilevelMesh::append`]).
///
/// Vertex indices are global: the vertices of all levels are numbered in the order in which they arrive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Level {
    /// The vertices that are new.
    pub vertices: Vertices,
    /// New triangles; an index may point past what has arrived if a representative is known for it (A.21).
    pub triangles: Vec<[u32; 3]>,
    /// (vertex, representative), for new vertices and for vertices that have not arrived yet. The representative has a
    /// lower index and arrives at an earlier level.
    pub representatives: Vec<(u32, u32)>,
    /// Corners of existing triangles that move from a representative to a new vertex.
    pub corner_moves: Vec<CornerMove>,
    /// Triangles of earlier levels that this one replaces: in foreign streams, where no representative can say what becomes of
    /// them. Finer levels do not have them.
    pub retired: Vec<u32>,
    /// Vertices of earlier levels that stand elsewhere from this level on (A.9f, D.9).
    pub moved: MovedVertices,
    /// Seams: (new vertex, earlier vertex that has the same position).
    pub position_of: Vec<(u32, u32)>,
}

/// One corner of an existing triangle moves to a new vertex; it must hold that vertex's representative now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CornerMove {
    /// Index of the triangle, in order of arrival.
    pub triangle: u32,
    /// 0, 1 or 2.
    pub corner: u8,
    /// The new vertex.
    pub vertex: u32,
}

/// New positions and attributes of existing vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovedVertices {
    /// Which vertices move; each at most once a level.
    pub ids: Vec<u32>,
    /// What they become, one entry an id.
    pub values: Vertices,
}
