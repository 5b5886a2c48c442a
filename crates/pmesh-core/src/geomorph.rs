//! Fractional levels (A.13, A.14): the four numbers that select one.

/// All that a renderer needs to draw a level: prefix lengths and a fraction.
///
/// Draw the first `triangle_count` triangles; each corner stands at
/// `mix(fine, coarse, fraction)`, `fine` being its first ancestor below `vertex_count` and `coarse` the first below
/// `coarse_vertex_count`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prefix {
    /// Vertices of level `floor(x)`.
    pub vertex_count: u32,
    /// Vertices of level `ceil(x)`.
    pub coarse_vertex_count: u32,
    /// Triangles of level `floor(x)`, those included that are replaced there ([`crate::ProgressiveMultilevelMesh::is_retired_at`]).
    pub triangle_count: u32,
    /// `fract(x)`: 0 is the finer level exactly.
    pub fraction: f32,
}
