//! Smooth vertex normals: area-weighted means over all triangles at a *position*, so that texture seams do not show.

use crate::ProgressiveMultilevelMesh;
use crate::forest::ancestor_below;

/// Sums triangle normals in slices, so that a page is never blocked, then normalises.
#[derive(Clone, Debug, Default)]
pub struct NormalAccumulator {
    sums: Vec<[f32; 3]>,
    next_triangle: usize,
}

impl NormalAccumulator {
    /// For `vertex_count` vertices. 12 bytes each.
    pub fn new(vertex_count: usize) -> Self {
        Self { sums: vec![[0.0; 3]; vertex_count], next_triangle: 0 }
    }
    /// Vertices summed for.
    pub fn vertex_count(&self) -> usize {
        self.sums.len()
    }
    /// Adds up to `limit` more triangles; true once all of `triangles` are in. Corners past the vertices count for their
    /// first representative inside, so that levels may go on arriving meanwhile; without one the triangle is skipped.
    pub fn add(&mut self, mesh: (&[[f32; 3]], &[u32]), triangles: &[[u32; 3]], limit: usize, gone: impl Fn(u32) -> bool) -> bool {
        let (positions, parents) = mesh;
        let count = self.sums.len() as u32;
        let end = self.next_triangle.saturating_add(limit).min(triangles.len());
        for (i, t) in triangles.iter().enumerate().take(end).skip(self.next_triangle) {
            if gone(i as u32) {
                continue;
            }
            let t = t.map(|v| if v < count { v } else { ancestor_below(parents, v, count) });
            if t.iter().any(|&v| v >= count) {
                continue;
            }
            let [a, b, c] = t.map(|v| positions[v as usize]);
            let n = cross(sub(b, a), sub(c, a));
            for v in t {
                let s = &mut self.sums[v as usize];
                (0..3).for_each(|k| s[k] += n[k]);
            }
        }
        self.next_triangle = end;
        end == triangles.len()
    }
    /// Gives vertices that share a position (`seams`, as in `IndexedMesh::position_of`) one sum; once, when all is in.
    fn join(&mut self, seams: &[(u32, u32)]) {
        let known = |v: u32| (v as usize) < self.sums.len();
        let seams: Vec<_> = seams.iter().filter(|&&(v, p)| known(v) && known(p)).collect();
        for &&(v, p) in &seams {
            let s = self.sums[v as usize];
            (0..3).for_each(|k| self.sums[p as usize][k] += s[k]);
        }
        for &&(v, p) in &seams {
            self.sums[v as usize] = self.sums[p as usize];
        }
    }
    /// Ends the sums of `mesh`, once, when all is in: [`Self::join`] over its seams as they are by now, and each place where a vertex stood
    /// before has the normal of where it stands now. O(vertices) where vertices move, else O(seams).
    pub fn finish(&mut self, mesh: &ProgressiveMultilevelMesh) {
        let Some(versions) = &mesh.versions else { return self.join(&mesh.seams) };
        let count = self.sums.len() as u32;
        let newest = versions.newest_below(count);
        let now = |entry: u32| newest[versions.logical(entry) as usize];
        let position = |v: u32| mesh.vertices.positions[v as usize];
        let seams = mesh.seams.iter().filter(|s| s.0 < count && s.1 < count).map(|&(v, p)| (now(v), now(p)));
        self.join(&seams.filter(|&(v, p)| position(v) == position(p)).collect::<Vec<_>>());
        for v in 0..count {
            self.sums[v as usize] = self.sums[now(v) as usize];
        }
    }
    /// The unit normal of a vertex; +z if it has no area.
    pub fn normal(&self, v: u32) -> [f32; 3] {
        unit(self.sums[v as usize])
    }
}

/// Smooth normals of a whole mesh. O(triangles).
pub fn smooth_normals(positions: &[[f32; 3]], triangles: &[[u32; 3]], seams: &[(u32, u32)]) -> Vec<[f32; 3]> {
    let mut sums = NormalAccumulator::new(positions.len());
    sums.add((positions, &[]), triangles, usize::MAX, |_| false);
    sums.join(seams);
    (0..positions.len() as u32).map(|v| sums.normal(v)).collect()
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
fn unit(n: [f32; 3]) -> [f32; 3] {
    // Scale first: the square of a small triangle's area underflows.
    let m = n.iter().fold(0.0f32, |m, x| m.max(x.abs()));
    if m == 0.0 || !m.is_finite() {
        return [0.0, 0.0, 1.0];
    }
    let n = n.map(|x| x / m);
    let l = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    n.map(|x| x / l)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tiny_flat_triangle_has_its_exact_normal_and_degenerate_ones_a_unit_vector() {
        let s = 1e-18;
        let p = [[0.0; 3], [s, 0.0, 0.0], [0.0, s, 0.0], [1.0, 1.0, 1.0]];
        let n = smooth_normals(&p, &[[0, 1, 2]], &[]);
        assert_eq!(n, vec![[0.0, 0.0, 1.0]; 4]);
    }

    #[test]
    fn a_place_that_a_vertex_has_left_has_the_normal_of_where_it_went() {
        let at = |positions: &[[f32; 3]]| crate::Vertices { positions: positions.to_vec(), ..Default::default() };
        let base = crate::Level {
            vertices: at(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
            triangles: vec![[0, 1, 2], [3, 4, 5]],
            position_of: vec![(3, 0), (4, 2)],
            ..Default::default()
        };
        let values = at(&[[0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [2.0, 0.0, 0.0]]);
        let moved = crate::MovedVertices { ids: vec![0, 3, 1], values };
        let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
        mesh.add_level(&base).expect("a base");
        mesh.add_level(&crate::Level { moved, ..Default::default() }).expect("a move");
        let mut sums = NormalAccumulator::new(9);
        sums.add((&mesh.vertices().positions, mesh.representatives()), mesh.triangles(), usize::MAX, |_| false);
        sums.finish(&mesh);
        let finest = mesh.finest_mesh();
        let expected = smooth_normals(&finest.vertices.positions, &finest.triangles, &finest.position_of);
        for (entry, vertex) in [(0, 0), (6, 0), (3, 3), (7, 3), (1, 1), (8, 1), (2, 2), (4, 4), (5, 5)] {
            assert_eq!(sums.normal(entry), expected[vertex], "{entry}");
        }
    }

    #[test]
    fn both_sides_of_a_seam_share_a_normal() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let n = smooth_normals(&p, &[[0, 1, 2], [3, 4, 5]], &[(3, 0), (4, 2)]);
        assert_eq!(n[0], n[3]);
        assert!((n[0][0] - n[0][2]).abs() < 1e-6 && n[0][0] > 0.7);
    }
}
