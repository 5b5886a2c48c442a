//! Batches of collapses to splits.

use super::level::{SplitCoder, SplitModel, SplitTruth};
use crate::pmesh::header::Container;
use crate::range::Encoder;
use crate::refine::encode::{Writer, misfit};
use crate::{EncodeError, Texture};
use pmesh_core::IndexedMesh;
use pmesh_core::surface::{NONE, Surface, next};
use std::collections::HashMap;
use std::io::Write;

/// A mesh and the forest of collapses that takes it apart, in batches of which each is a forest of triangles.
#[derive(Clone, Debug, Default)]
pub struct SplitStream {
    /// The finest mesh.
    pub mesh: IndexedMesh,
    /// For each vertex the one that stands for it in the level before its own; no matter which for those of level 0.
    pub parents: Vec<u32>,
    /// Level at which each vertex comes, 0 the base.
    pub levels: Vec<u32>,
    /// Geometric error of each level, the base first; model units.
    pub errors: Vec<f32>,
    /// The base-colour image.
    pub texture: Option<Texture>,
}

impl SplitReport {
    /// Bits of connectivity a new triangle, before entropy coding.
    pub fn raw_bits_per_triangle(&self) -> f64 {
        let bits: u64 = self.splits.iter().map(|s| s.bits).sum();
        bits as f64 / (2.0 * f64::from(self.removed.0)).max(1.0)
    }
}

impl SplitStream {
    /// For each vertex the one that stands for it at `level`. O(vertices), or a little more.
    pub fn at_level(&self, level: u32) -> Vec<u32> {
        let stands = |mut v: u32| {
            // Parents have smaller levels, so this ends.
            while self.levels[v as usize] > level {
                v = self.parents[v as usize];
            }
            v
        };
        (0..self.levels.len() as u32).map(stands).collect()
    }
    /// Levels, the base counted.
    pub fn level_count(&self) -> u32 {
        self.levels.iter().max().map_or(1, |l| l + 1)
    }
}

/// What the connectivity of one split costs before entropy coding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SplitCost {
    /// Triangles of the mesh that is refined.
    pub coarse_triangles: u32,
    /// Triangles that the split adds.
    pub new_triangles: u32,
    /// A bit for each mark of an edge and each step of the parser, forced ones left out (A.31).
    pub bits: u64,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplitReport {
    /// Vertices and triangles of the base mesh, and its bytes.
    pub base: (u32, u32, usize),
    /// Vertices of no triangle, and their bytes.
    pub loose: (u32, usize),
    /// Vertices of the splits, and their bytes.
    pub removed: (u32, usize),
    /// Bytes of the splits that say how the surface changes and which copies keep their places; the rest are displacements.
    pub connectivity: usize,
    /// What each split costs before entropy coding.
    pub splits: Vec<SplitCost>,
    /// Bits before entropy coding that say which copy keeps its place.
    pub keep_bits: u64,
}

fn vanishes([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// Writes a stream. `position_bits` as in `.pmesh`. O(n levels). Errors: more levels than a table holds, batches that are no
/// forests, or a failing writer.
pub fn encode(stream: &SplitStream, position_bits: Option<u8>, out: &mut impl Write) -> Result<SplitReport, EncodeError> {
    let mesh = &stream.mesh;
    let n = mesh.vertices.len();
    let falls =
        |v: usize| stream.levels[v] == 0 || stream.levels.get(stream.parents[v] as usize).is_some_and(|&l| l < stream.levels[v]);
    if stream.levels.len() != n || stream.parents.len() != n || !(0..n).all(falls) {
        return Err(misfit("a vertex whose parent is not of an earlier level"));
    }
    let mut stands = stream.at_level(0);
    // Triangles by the level at which they come; the finest mesh's own degenerate ones are the base's.
    let mut coarse: Vec<u32> = Vec::new();
    let mut waiting: Vec<u32> = Vec::new();
    for (i, &t) in mesh.triangles.iter().enumerate() {
        let later = vanishes(t.map(|v| stands[v as usize])) && !vanishes(t);
        let list = if later { &mut waiting } else { &mut coarse };
        list.push(i as u32);
    }
    let base: Vec<[u32; 3]> = coarse.iter().map(|&i| mesh.triangles[i as usize].map(|v| stands[v as usize])).collect();
    let later = |v: u32| stream.levels[v as usize] > 0;
    let mut writer =
        Writer::new(Container::Forest, (mesh, &mesh.position_of), position_bits, &base, later, stream.errors.first(), |_| 0)?;
    let mut report = SplitReport { base: writer.base, ..Default::default() };
    // For each coded triangle its place in the mesh.
    let mut triangle_order: Vec<u32> = writer.triangle_order.iter().map(|&i| coarse[i as usize]).collect();
    let mut coded = writer.coded();
    let mut model = SplitModel::new(writer.rows.width);
    for level in 1..stream.level_count() {
        let finer = stream.at_level(level);
        let mut third = HashMap::new();
        let mut marked = vec![false; writer.surface.across.len()];
        let mut place_of = HashMap::new();
        let mut rest = Vec::new();
        for &i in &waiting {
            let t = mesh.triangles[i as usize].map(|v| finer[v as usize]);
            if vanishes(t) {
                rest.push(i);
                continue;
            }
            for k in 0..3 {
                third.insert((t[k], t[(k + 1) % 3]), t[(k + 2) % 3]);
                let [a, b] = [t[k], t[(k + 1) % 3]].map(|v| coded[stands[v as usize] as usize]);
                if a != b {
                    mark(&writer.surface, &mut marked, a, b).ok_or("an edge that is none of the surface").map_err(misfit)?;
                }
            }
            place_of.insert((t[0], t[1]), i);
        }
        waiting = rest;
        let corners = |t: usize| {
            let (now, source) = (writer.surface.triangles[t], mesh.triangles[triangle_order[t] as usize]);
            now.map(|v| {
                let own = writer.vertex_order[v as usize];
                source.into_iter().find(|&s| stands[s as usize] == own).map_or(own, |s| finer[s as usize])
            })
        };
        let finer_corners: Vec<[u32; 3]> = (0..triangle_order.len()).map(corners).collect();
        let before = writer.rows.count();
        let total = stream.levels.iter().filter(|&&l| l == level).count() as u32;
        let (payload, connectivity, asked) = {
            let (source, rows) = (&writer.source, &mut writer.rows);
            let mut truth = SplitTruth {
                marked: &marked,
                finer: &finer_corners,
                third: &third,
                rows: source,
                vertex_order: &mut writer.vertex_order,
            };
            let mut split = SplitCoder::new(total);
            let (mut coder, mut bytes, mut part) = (Encoder::new(), 0, Default::default());
            while !split
                .step(&mut coder, &mut model, (&mut writer.surface, &mut *rows), Some(&mut truth), usize::MAX, &mut part)
                .map_err(misfit)?
            {
                if split.surface_is_coded() {
                    bytes = coder.byte_count();
                }
            }
            (coder.finish(), bytes, split.count)
        };
        for v in before..writer.rows.count() {
            coded[writer.vertex_order[v as usize] as usize] = v;
        }
        for t in &writer.surface.triangles[triangle_order.len()..] {
            let own = t.map(|v| writer.vertex_order[v as usize]);
            let place = (0..3).find_map(|k| place_of.get(&(own[k], own[(k + 1) % 3])).copied());
            triangle_order.push(place.ok_or("a triangle that is none of the mesh").map_err(misfit)?);
        }
        report.removed.0 += total;
        report.removed.1 += payload.len();
        report.connectivity += connectivity;
        let (coarse_triangles, bits) = (finer_corners.len() as u32, asked.marks + asked.joins);
        report.splits.push(SplitCost { coarse_triangles, new_triangles: 2 * total, bits });
        report.keep_bits += asked.keeps;
        writer.level(total, payload, stream.errors.get(level as usize));
        stands = finer;
    }
    if !waiting.is_empty() {
        return Err(misfit("triangles that no level brings"));
    }
    report.loose = writer.finish(stream.texture.as_ref(), out)?;
    Ok(report)
}

/// Marks the edge between two vertices, seen from both sides.
fn mark(surface: &Surface, marked: &mut [bool], a: u32, b: u32) -> Option<()> {
    // A vertex whose triangles have all vanished is not on the surface.
    let start = *surface.corner_of.get(a as usize)?;
    let edge = |&c: &u32| surface.vertex(next(c)) == b && surface.across[c as usize] != NONE;
    let at = Some(start).filter(|&c| c != NONE).and_then(|c| surface.around(c).find(edge))?;
    (marked[at as usize], marked[surface.across[at as usize] as usize]) = (true, true);
    Some(())
}
