//! The structure itself: what it holds, how levels are numbered, and how one is selected. Growing it is in `append`.

use crate::forest::compress;
use crate::pending::Pending;
use crate::retired::Retired;
use crate::versions::Versions;
use crate::{AttributeSet, MeshError, Prefix, Vertices};

/// Where a level ends in the arrays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LevelEnd {
    pub(crate) vertices: u32,
    pub(crate) triangles: u32,
    /// Entries up to here that are superseded versions.
    pub(crate) superseded: u32,
    /// Triangles up to here that are replaced by then.
    pub(crate) retired: u32,
}

/// A mesh at all its levels of detail at once (A.9).
///
/// | array | bytes a vertex (T = 2V) |
/// |---|---|
/// | positions | 12 |
/// | triangles, finest indices | 24 |
/// | representatives | 4 |
///
/// so 40 against the 36 of a plain indexed mesh (A.12); attributes cost the same in both. A vertex that moves costs one
/// more entry a move.
///
/// Levels are numbered as in the paper: of `L` levels, `L-1` is the coarsest and arrives first, `0` is the finest.
/// While `L` is unknown it is the number that has arrived.
#[derive(Clone, Debug)]
pub struct ProgressiveMultilevelMesh {
    pub(crate) attribute_set: AttributeSet,
    pub(crate) vertices: Vertices,
    /// Representative of each entry: lower, of an earlier level, or `NO_REPRESENTATIVE`.
    pub(crate) parents: Vec<u32>,
    /// Corners hold the finest vertex that has arrived.
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) ends: Vec<LevelEnd>,
    pub(crate) seams: Vec<(u32, u32)>,
    pub(crate) pending: Pending,
    pub(crate) versions: Option<Box<Versions>>,
    pub(crate) retired: Retired,
    declared_levels: Option<u32>,
    requested: Option<f64>,
}

impl ProgressiveMultilevelMesh {
    /// An empty mesh whose vertices will carry `attribute_set`.
    pub fn new(attribute_set: AttributeSet) -> Self {
        Self {
            attribute_set,
            vertices: Vertices::default(),
            parents: Vec::new(),
            triangles: Vec::new(),
            ends: Vec::new(),
            seams: Vec::new(),
            pending: Pending::default(),
            versions: None,
            retired: Retired::default(),
            declared_levels: None,
            requested: None,
        }
    }

    /// Says how many levels there will be, as a format with a header knows. Fewer than have arrived is ignored.
    pub fn declare_level_count(&mut self, count: u32) {
        self.declared_levels = Some(count);
    }
    /// The attributes that vertices carry.
    pub fn attribute_set(&self) -> AttributeSet {
        self.attribute_set
    }
    /// Levels that have arrived completely.
    pub fn arrived_levels(&self) -> u32 {
        self.ends.len() as u32
    }
    /// `L`: the declared number of levels, or those that have arrived.
    pub fn level_count(&self) -> u32 {
        self.declared_levels.unwrap_or(0).max(self.arrived_levels())
    }
    /// Number of the finest level that has arrived; 0 once all have.
    pub fn finest_level(&self) -> u32 {
        self.level_count() - self.arrived_levels()
    }

    fn no_such_level(&self, level: f64) -> MeshError {
        MeshError::NoSuchLevel { level, coarsest: self.level_count().saturating_sub(1), finest: self.finest_level() }
    }
    pub(crate) fn end(&self, level: u32) -> Result<LevelEnd, MeshError> {
        let count = self.level_count();
        let error = self.no_such_level(level.into());
        let step = count.checked_sub(1).and_then(|last| last.checked_sub(level)).ok_or(error.clone())?;
        self.ends.get(step as usize).copied().ok_or(error)
    }
    /// Vertices of a level, those that moved counted once. O(1).
    pub fn vertex_count(&self, level: u32) -> Result<u32, MeshError> {
        self.end(level).map(|e| e.vertices - e.superseded)
    }
    /// Length of the vertex prefix of a level, superseded versions included. O(1).
    pub fn vertex_end(&self, level: u32) -> Result<u32, MeshError> {
        self.end(level).map(|e| e.vertices)
    }
    /// Triangles of a level. O(1).
    pub fn triangle_count(&self, level: u32) -> Result<u32, MeshError> {
        self.end(level).map(|e| e.triangles - e.retired)
    }
    /// Length of the triangle prefix of a level, replaced ones included. O(1).
    pub fn triangle_end(&self, level: u32) -> Result<u32, MeshError> {
        self.end(level).map(|e| e.triangles)
    }

    /// Asks for a level, fractional ones too. It is kept; until it has arrived the nearest one that has is shown.
    /// Nothing is built: O(1). Errors: not a number.
    pub fn set_level(&mut self, x: f64) -> Result<(), MeshError> {
        if x.is_nan() {
            return Err(MeshError::LevelIsNaN);
        }
        self.requested = Some(x);
        Ok(())
    }
    /// Shows the newest finished level from now on, as before any [`Self::set_level`] (A.16).
    pub fn follow_newest(&mut self) {
        self.requested = None;
    }
    /// The level asked for, or `None` while the newest is shown.
    pub fn requested_level(&self) -> Option<f64> {
        self.requested
    }
    /// The level shown: the one asked for, clamped to those that have arrived.
    pub fn level(&self) -> f64 {
        let (finest, coarsest) = (self.finest_level(), self.level_count().saturating_sub(1));
        self.requested.unwrap_or(0.0).max(finest.into()).min(coarsest.into())
    }

    /// The numbers that select level `x`, which must have arrived. O(1).
    pub fn prefix_of(&self, x: f64) -> Result<Prefix, MeshError> {
        if x.is_nan() {
            return Err(MeshError::LevelIsNaN);
        }
        if self.ends.is_empty() {
            return Err(MeshError::Empty);
        }
        if x < 0.0 || x > f64::from(self.level_count()) {
            return Err(self.no_such_level(x));
        }
        let fine = self.end(x.floor() as u32)?;
        let coarse = self.end(x.ceil() as u32)?;
        Ok(Prefix {
            vertex_count: fine.vertices,
            coarse_vertex_count: coarse.vertices,
            triangle_count: fine.triangles,
            fraction: x.fract() as f32,
        })
    }
    /// The numbers that select [`Self::level`]; all zero before the first level. O(1).
    pub fn prefix(&self) -> Prefix {
        self.prefix_of(self.level()).unwrap_or_default()
    }

    /// Triangles of a level with every corner at its representative, by path compression on a temporary copy (A.4);
    /// degenerate ones are left out. O(vertices past the prefix + triangles of the level).
    pub fn triangles_at(&self, level: u32) -> Result<Vec<[u32; 3]>, MeshError> {
        let end = self.end(level)?;
        let roots = compress(&self.parents, end.vertices);
        let resolve = |v: u32| if v < end.vertices { v } else { roots[(v - end.vertices) as usize] };
        let there = (0..end.triangles).filter(|&t| !self.is_retired_at(t, level));
        Ok(there.map(|t| self.triangles[t as usize].map(resolve)).filter(|[a, b, c]| a != b && b != c && c != a).collect())
    }

    /// Every vertex entry that has arrived, coarsest first.
    pub fn vertices(&self) -> &Vertices {
        &self.vertices
    }
    /// Representative of every entry, [`crate::forest::NO_REPRESENTATIVE`] where there is none.
    pub fn representatives(&self) -> &[u32] {
        &self.parents
    }
    /// Every triangle that has arrived, coarsest first, corners at the finest vertex that has arrived.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
    /// Seams: (entry, earlier entry at the same position).
    pub fn seams(&self) -> &[(u32, u32)] {
        &self.seams
    }
    /// True if vertices move between levels.
    pub fn has_moves(&self) -> bool {
        self.versions.is_some()
    }
    /// True if some triangle still waits for its finest vertices.
    pub fn has_pending_vertices(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Room for as many vertices and triangles in all as a level table announces: no copying, and nothing unused, while they come. It is
    /// not believed beyond three times what is there.
    pub fn reserve(&mut self, vertices: u32, triangles: u32) {
        let more = |all: u32, there: usize| (all as usize).saturating_sub(there).min(2 * there);
        let (v, t) = (more(vertices, self.vertices.len()), more(triangles, self.triangles.len()));
        self.vertices.reserve(v);
        self.parents.reserve_exact(v);
        self.triangles.reserve_exact(t);
    }
    /// Gives back what growing reserved; called once a stream has ended.
    pub fn shrink_to_fit(&mut self) {
        self.vertices.shrink_to_fit();
        self.parents.shrink_to_fit();
        self.triangles.shrink_to_fit();
        self.ends.shrink_to_fit();
        self.seams.shrink_to_fit();
    }
    /// Bytes allocated, this structure included, vertices that have not arrived excepted.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>()
            + self.vertices.memory_bytes()
            + self.parents.capacity() * 4
            + self.triangles.capacity() * 12
            + self.ends.capacity() * size_of::<LevelEnd>()
            + self.seams.capacity() * 8
            + self.retired.memory_bytes()
            + self.versions.as_ref().map_or(0, |v| v.memory_bytes())
    }

    /// Panics unless the structure holds its invariants; tests call it after each operation.
    pub fn check_invariants(&self) {
        let n = self.vertices.len() as u32;
        assert_eq!(self.parents.len() as u32, n);
        let level_of = |v: u32| self.ends.partition_point(|e| e.vertices <= v);
        for (v, &p) in self.parents.iter().enumerate() {
            let v = v as u32;
            assert!(p == crate::forest::NO_REPRESENTATIVE || (p < v && level_of(p) < level_of(v)), "{v} -> {p}");
        }
        assert!(self.triangles.iter().flatten().all(|&v| v < n));
        assert!(self.retired.count() <= self.triangles.len() as u32);
        let monotone = |w: &[LevelEnd]| w[0].vertices <= w[1].vertices && w[0].triangles <= w[1].triangles;
        assert!(self.ends.windows(2).all(monotone));
        if let Some(e) = self.ends.last() {
            assert!(e.vertices <= n && e.triangles as usize <= self.triangles.len());
        }
    }
}
