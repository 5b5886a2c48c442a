//! Exact distances between surfaces, for benchmarks and tests: sampled points of one against all triangles of the other.

use crate::vector::{Point, dot, from_triangle, sub};
use pmesh_core::IndexedMesh;

/// Root mean square and maximum distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Root mean square.
    pub rms: f64,
    /// Maximum.
    pub max: f64,
}

/// Two-sided deviation of two meshes, in parts of the bounding-box diagonal of `a`: `samples` points a side, spread by area
/// with a fixed sequence, exact point-to-triangle distances through a grid. O(samples × cells).
pub fn deviation(a: &IndexedMesh, b: &IndexedMesh, samples: usize) -> Deviation {
    let (low, high) = a.bounds();
    let diagonal = (0..3).map(|k| f64::from(high[k] - low[k]).powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    let sides = [one_sided(a, b, samples), one_sided(b, a, samples)];
    let mean = (sides[0].rms.powi(2) + sides[1].rms.powi(2)) / 2.0;
    Deviation { rms: mean.sqrt() / diagonal, max: sides[0].max.max(sides[1].max) / diagonal }
}

fn one_sided(from: &IndexedMesh, to: &IndexedMesh, samples: usize) -> Deviation {
    let points = sample(from, samples);
    if points.is_empty() || to.triangles.is_empty() {
        return Deviation { rms: f64::INFINITY, max: f64::INFINITY };
    }
    let grid = Grid::new(to);
    let squares = points.iter().map(|p| grid.distance_squared(*p));
    let (sum, max) = squares.fold((0.0, 0.0f64), |(s, m), d| (s + d, m.max(d)));
    Deviation { rms: (sum / points.len() as f64).sqrt(), max: max.sqrt() }
}

fn corners(mesh: &IndexedMesh, t: usize) -> [Point; 3] {
    mesh.triangles[t].map(|v| mesh.vertices.positions[v as usize].map(f64::from))
}
fn area(t: [Point; 3]) -> f64 {
    let (u, v) = (sub(t[1], t[0]), sub(t[2], t[0]));
    (dot(u, u) * dot(v, v) - dot(u, v).powi(2)).max(0.0).sqrt() / 2.0
}

/// Points spread by area: stratified over the cumulated area, the place in a triangle from the R2 sequence.
fn sample(mesh: &IndexedMesh, count: usize) -> Vec<Point> {
    let mut total = 0.0;
    let cumulated: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| {
            total += area(corners(mesh, t));
            total
        })
        .collect();
    if total <= 0.0 {
        return mesh.vertices.positions.iter().map(|p| p.map(f64::from)).collect();
    }
    let mut t = 0;
    (0..count)
        .map(|i| {
            let at = (i as f64 + 0.5) / count as f64 * total;
            while cumulated[t] < at && t + 1 < cumulated.len() {
                t += 1;
            }
            let (r, s) = ((0.5 + i as f64 * 0.754_877_666_246_692_7).fract(), (0.5 + i as f64 * 0.569_840_290_998_053_2).fract());
            let (r, s) = if r + s > 1.0 { (1.0 - r, 1.0 - s) } else { (r, s) };
            let [a, b, c] = corners(mesh, t);
            std::array::from_fn(|k| a[k] + r * (b[k] - a[k]) + s * (c[k] - a[k]))
        })
        .collect()
}

/// Triangles in the cells of a uniform grid.
struct Grid<'a> {
    mesh: &'a IndexedMesh,
    low: Point,
    cell: f64,
    size: [usize; 3],
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl<'a> Grid<'a> {
    fn new(mesh: &'a IndexedMesh) -> Self {
        let (low, high) = mesh.bounds();
        let extent: Point = std::array::from_fn(|k| f64::from(high[k] - low[k]));
        let longest = extent.iter().fold(f64::MIN_POSITIVE, |m, &x| m.max(x));
        let cells = ((mesh.triangles.len() as f64).sqrt() * 0.7).clamp(1.0, 160.0);
        let cell = longest / cells;
        let size = extent.map(|x| ((x / cell) as usize + 1).min(256));
        let mut grid = Self { mesh, low: low.map(f64::from), cell, size, starts: vec![], items: vec![] };
        let mut counts = vec![0u32; size.iter().product::<usize>() + 1];
        for t in 0..mesh.triangles.len() {
            grid.cells_of(t, |c| counts[c + 1] += 1);
        }
        (1..counts.len()).for_each(|i| counts[i] += counts[i - 1]);
        let mut fill = counts.clone();
        grid.items = vec![0; counts[counts.len() - 1] as usize];
        let mut items = std::mem::take(&mut grid.items);
        for t in 0..mesh.triangles.len() {
            grid.cells_of(t, |c| {
                items[fill[c] as usize] = t as u32;
                fill[c] += 1;
            });
        }
        (grid.items, grid.starts) = (items, counts);
        grid
    }
    fn coordinate(&self, p: Point) -> [usize; 3] {
        std::array::from_fn(|k| (((p[k] - self.low[k]) / self.cell).max(0.0) as usize).min(self.size[k] - 1))
    }
    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }
    fn cells_of(&self, t: usize, mut visit: impl FnMut(usize)) {
        let [a, b, c] = corners(self.mesh, t);
        let low = self.coordinate(std::array::from_fn(|k| a[k].min(b[k]).min(c[k])));
        let high = self.coordinate(std::array::from_fn(|k| a[k].max(b[k]).max(c[k])));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    visit(self.index([x, y, z]));
                }
            }
        }
    }
    /// Searches shells of cells around the point until none can hold anything closer.
    fn distance_squared(&self, p: Point) -> f64 {
        let home = self.coordinate(p);
        // How far the point lies outside the grid counts for every shell.
        let mut best = f64::INFINITY;
        let reach = self.size.iter().max().copied().unwrap_or(1);
        for shell in 0..=reach {
            let inner = (shell as f64 - 1.0).max(0.0) * self.cell;
            if best <= inner * inner {
                break;
            }
            self.shell(home, shell, |c| {
                for &t in &self.items[self.starts[c] as usize..self.starts[c + 1] as usize] {
                    best = best.min(point_triangle_squared(p, corners(self.mesh, t as usize)));
                }
            });
        }
        best
    }
    fn shell(&self, home: [usize; 3], r: usize, mut visit: impl FnMut(usize)) {
        let range = |k: usize| home[k].saturating_sub(r)..=(home[k] + r).min(self.size[k] - 1);
        for z in range(2) {
            for y in range(1) {
                let edge = z.abs_diff(home[2]) == r || y.abs_diff(home[1]) == r;
                if edge {
                    range(0).for_each(|x| visit(self.index([x, y, z])));
                } else {
                    [home[0].checked_sub(r), Some(home[0] + r)]
                        .into_iter()
                        .flatten()
                        .filter(|&x| x < self.size[0])
                        .for_each(|x| visit(self.index([x, y, z])));
                }
            }
        }
    }
}

/// Squared distance of a point to a triangle.
fn point_triangle_squared(p: Point, triangle: [Point; 3]) -> f64 {
    let from = from_triangle(p, triangle);
    dot(from, from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_finds_what_trying_every_triangle_finds() {
        let mesh = crate::sample::knot(24, 9);
        let grid = Grid::new(&mesh);
        for i in 0..200 {
            let p: Point = std::array::from_fn(|k| ((i * (k + 3)) as f64 * 0.37).sin() * 4.0);
            let all = (0..mesh.triangles.len()).map(|t| point_triangle_squared(p, corners(&mesh, t)));
            assert_eq!(grid.distance_squared(p), all.fold(f64::INFINITY, f64::min));
        }
    }

    #[test]
    fn a_mesh_deviates_from_itself_by_nothing() {
        let mesh = crate::sample::knot(24, 9);
        assert!(deviation(&mesh, &mesh, 1000).max < 1e-7);
    }
}
