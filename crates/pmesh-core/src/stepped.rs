//! Going from level to level at a cost in proportion to what changes (B.11), where path compression pays for all vertices.
//!
//! For each vertex of the level shown, the corners that it holds, in doubly linked lists: a finer level hands some of a
//! representative's corners to the new vertex, a coarser one gives them back.

use crate::forest::{JumpForest, NO_REPRESENTATIVE};
use crate::{MeshError, ProgressiveMultilevelMesh};

const NONE: u32 = u32::MAX;

/// One level of a mesh as triangles, moved step by step. Levels may go on arriving; the mesh must be the same one.
#[derive(Clone, Debug, Default)]
pub struct SteppedLevel {
    forest: JumpForest,
    /// Steps from the coarsest that are shown: levels, counted from that end.
    steps: u32,
    triangles: Vec<[u32; 3]>,
    /// First corner that each vertex holds.
    head: Vec<u32>,
    /// (next, before) of each corner in its list.
    links: Vec<(u32, u32)>,
}

impl SteppedLevel {
    /// Triangles of the level shown, corners at their representatives; index-degenerate ones of the input are among them.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
    /// Vertices of the level shown.
    pub fn vertex_count(&self) -> u32 {
        self.head.len() as u32
    }

    /// Goes to `level`, finer or coarser; gives the number of corners that were looked at or changed, which is what it
    /// costs: on the way to a finer level those of the split vertices, on the way back those of the vertices that go.
    /// Errors: a level that has not arrived; vertices that move or triangles that are replaced between levels.
    pub fn set_level(&mut self, mesh: &ProgressiveMultilevelMesh, level: u32) -> Result<u64, MeshError> {
        mesh.triangle_count(level)?;
        if mesh.has_moves() || mesh.has_retired() {
            return Err(MeshError::NotStepped);
        }
        self.forest.grow(mesh.representatives());
        let wanted = mesh.level_count() - level;
        let mut touched = 0;
        while self.steps < wanted {
            touched += self.finer(mesh)?;
        }
        while self.steps > wanted {
            touched += self.coarser(mesh)?;
        }
        Ok(touched)
    }

    fn end_of(mesh: &ProgressiveMultilevelMesh, steps: u32) -> Result<(u32, usize), MeshError> {
        if steps == 0 {
            return Ok((0, 0));
        }
        let level = mesh.level_count() - steps;
        Ok((mesh.vertex_end(level)?, mesh.triangle_count(level)? as usize))
    }

    fn finer(&mut self, mesh: &ProgressiveMultilevelMesh) -> Result<u64, MeshError> {
        let (vertices, triangles) = Self::end_of(mesh, self.steps + 1)?;
        let finest = mesh.triangles().as_flattened();
        let mut touched = 0;
        for v in self.head.len() as u32..vertices {
            self.head.push(NONE);
            let parent = mesh.representatives()[v as usize];
            if parent == NO_REPRESENTATIVE {
                continue;
            }
            let mut corner = self.head[parent as usize];
            while corner != NONE {
                let next = self.links[corner as usize].0;
                touched += 1;
                if self.forest.ancestor_below(finest[corner as usize], v + 1).0 == v {
                    self.unlink(corner, parent);
                    self.link(corner, v);
                }
                corner = next;
            }
        }
        for t in self.triangles.len()..triangles {
            self.triangles.push([NONE; 3]);
            self.links.extend([(NONE, NONE); 3]);
            for k in 0..3 {
                let corner = 3 * t + k;
                let (v, _) = self.forest.ancestor_below(finest[corner], vertices);
                self.link(corner as u32, v);
                touched += 1;
            }
        }
        self.steps += 1;
        Ok(touched)
    }

    fn coarser(&mut self, mesh: &ProgressiveMultilevelMesh) -> Result<u64, MeshError> {
        let (vertices, triangles) = Self::end_of(mesh, self.steps - 1)?;
        let mut touched = 0;
        while self.triangles.len() > triangles {
            for k in 0..3 {
                let corner = 3 * (self.triangles.len() - 1) + k;
                let v = self.triangles[corner / 3][k];
                self.unlink(corner as u32, v);
                touched += 1;
            }
            self.triangles.pop();
            self.links.truncate(3 * self.triangles.len());
        }
        while self.head.len() as u32 > vertices {
            let v = self.head.len() as u32 - 1;
            let parent = mesh.representatives()[v as usize];
            while self.head[v as usize] != NONE {
                let corner = self.head[v as usize];
                self.unlink(corner, v);
                // A vertex without representative leaves with its triangles; none can be left here.
                if parent != NO_REPRESENTATIVE {
                    self.link(corner, parent);
                }
                touched += 1;
            }
            self.head.pop();
        }
        self.steps -= 1;
        Ok(touched)
    }

    fn link(&mut self, corner: u32, v: u32) {
        let first = std::mem::replace(&mut self.head[v as usize], corner);
        self.links[corner as usize] = (first, NONE);
        if first != NONE {
            self.links[first as usize].1 = corner;
        }
        self.triangles[corner as usize / 3][corner as usize % 3] = v;
    }
    fn unlink(&mut self, corner: u32, v: u32) {
        let (next, before) = self.links[corner as usize];
        match before {
            NONE => self.head[v as usize] = next,
            before => self.links[before as usize].0 = next,
        }
        if next != NONE {
            self.links[next as usize].1 = before;
        }
    }
}

/// Cluster sizes of a mesh with a level a vertex (B.3, B.5): which level a threshold asks for, while vertices still arrive.
///
/// The size of a split is the distance of the new vertex from its representative. A level is fine enough for a threshold
/// once no later split is larger (B.10), so only splits that are larger than all after them matter: those are kept.
#[derive(Clone, Debug, Default)]
pub struct ClusterSizes {
    /// (step of the split, size), steps ascending, sizes falling.
    record: Vec<(u32, f32)>,
    vertices: u32,
}

impl ClusterSizes {
    /// Takes in the vertices that have arrived since. Amortised O(new vertices).
    pub fn grow(&mut self, mesh: &ProgressiveMultilevelMesh) {
        let positions = &mesh.vertices().positions;
        for (v, &parent) in mesh.representatives().iter().enumerate().skip(self.vertices as usize) {
            let size = match parent {
                // Nothing stands for it without it.
                NO_REPRESENTATIVE => f32::INFINITY,
                p => distance(positions[v], positions[p as usize]),
            };
            while self.record.last().is_some_and(|last| last.1 <= size) {
                self.record.pop();
            }
            self.record.push((v as u32, size));
        }
        self.vertices = mesh.representatives().len() as u32;
    }
    /// Vertices of the coarsest mesh in which no cluster is larger than `threshold` (model units), among those that have
    /// arrived; the level is the one with so many. O(log).
    pub fn vertices_for(&self, threshold: f32) -> u32 {
        let larger = self.record.partition_point(|&(_, size)| size > threshold);
        larger.checked_sub(1).map_or(0, |last| self.record[last].0 + 1)
    }
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let squares: f64 = (0..3).map(|k| f64::from(a[k]) - f64::from(b[k])).map(|d| d * d).sum();
    squares.sqrt() as f32
}

impl ProgressiveMultilevelMesh {
    /// Variable resolution (B.17): the mesh in which only the vertices stand for which `is_wanted` says so and whose
    /// representatives all do too, such as those whose cluster is large on the screen. Vertices without representative
    /// always stand. Triangles with distinct corners; O(vertices + triangles).
    pub fn triangles_where(&self, mut is_wanted: impl FnMut(u32) -> bool) -> Vec<[u32; 3]> {
        let mut stands_for: Vec<u32> = Vec::with_capacity(self.parents.len());
        for (v, &parent) in self.parents.iter().enumerate() {
            let v = v as u32;
            stands_for.push(match parent {
                NO_REPRESENTATIVE => v,
                p if stands_for[p as usize] == p && is_wanted(v) => v,
                p => stands_for[p as usize],
            });
        }
        let corners = self.triangles.iter().map(|t| t.map(|v| stands_for[v as usize]));
        corners.filter(|[a, b, c]| a != b && b != c && c != a).collect()
    }
}
