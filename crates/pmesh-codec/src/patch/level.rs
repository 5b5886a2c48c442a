//! One level: the patches of the coarser mesh, then a vertex for each patch (C.5, C.6).
//!
//! Each triangle in canonical order is coded by what is known of its neighbours: whether it goes on a patch that has begun
//! there (never where no fan would come of it), else whether it begins one. That is what colours say, without their names:
//! which of three colours a patch has costs more than a bit a vertex and tells a decoder nothing.

use super::rows::{RowModel, Rows};
use super::surface::{CanonicalOrder, Fan, NONE, Surface};
use crate::range::{Chance, Coder, INPUTS, Mixer};
use pmesh_core::CornerMove;

/// What is known of a triangle.
#[derive(Clone, Copy, PartialEq)]
enum Membership {
    Unknown,
    /// In no patch.
    Outside,
    Inside,
}

/// Values of a context: sizes of patches, valences and areas are told apart up to there.
const CLASSES: usize = 8;
/// Three classes make a context.
const CONTEXTS: usize = CLASSES * CLASSES * CLASSES;

/// Chances of a yes or no by six contexts, mixed.
struct Question {
    mixers: [Mixer; CLASSES],
    chances: Vec<Chance>,
}

impl Question {
    fn new() -> Self {
        Self { mixers: std::array::from_fn(|_| Mixer::default()), chances: vec![Chance::default(); INPUTS * CONTEXTS] }
    }
    /// Each context is three classes below [`CLASSES`]; `weights` chooses the mixer.
    fn code(&mut self, coder: &mut impl Coder, weights: usize, contexts: [[usize; 3]; INPUTS], bit: bool) -> bool {
        let index = |[a, b, c]: [usize; 3]| (a.min(CLASSES - 1) * CLASSES + b.min(CLASSES - 1)) * CLASSES + c.min(CLASSES - 1);
        let mut parts = self.chances.chunks_mut(CONTEXTS);
        let mut spare = [Chance::default(); INPUTS];
        let mut spares = spare.iter_mut();
        let chances = contexts.map(|c| match (parts.next(), spares.next()) {
            (Some(part), _) => Some(&mut part[index(c)]),
            (None, spare) => spare,
        });
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = chances else { return bit };
        coder.mixed(&mut self.mixers[weights.min(CLASSES - 1)], [a, b, c, d, e, f], bit)
    }
}

/// Chances that go on learning from level to level.
pub(super) struct LevelModel {
    /// Does it go on this patch?
    join: Question,
    /// Does it begin one?
    begin: Question,
    rows: RowModel,
}

impl LevelModel {
    pub(super) fn new(width: usize) -> Self {
        Self { join: Question::new(), begin: Question::new(), rows: RowModel::new(width) }
    }
}

/// What the encoder knows: for each triangle of the coarser mesh the vertex that its patch gets, or [`NONE`].
pub(super) struct LevelTruth<'a> {
    pub(super) vertex: &'a [u32],
    pub(super) rows: &'a Rows,
    /// Vertices in the order in which they were coded.
    pub(super) vertex_order: &'a mut Vec<u32>,
}

/// A vertex that a level brings.
pub(super) struct Inserted {
    pub(super) vertex: u32,
    pub(super) apex: u32,
    pub(super) corner_moves: Vec<CornerMove>,
    pub(super) triangles: [[u32; 3]; 2],
}

enum Stage {
    Order,
    Patches,
    Vertices,
}

/// Triangles of one patch as far as they are known: a set in a union-find forest.
#[derive(Clone, Copy)]
struct Region {
    parent: u32,
    size: u32,
    /// Vertices that all its triangles share.
    shared: [u32; 3],
}

/// The coder of either direction, in steps.
pub(super) struct LevelCoder {
    stage: Stage,
    order: CanonicalOrder,
    members: Vec<Membership>,
    regions: Vec<Region>,
    at: usize,
    /// Patches in the order of their first triangles.
    patches: Vec<Vec<u32>>,
    patch_of_root: Vec<u32>,
    valences: Vec<u8>,
    /// Class of each triangle's area against the mean.
    areas: Vec<u8>,
    /// Whether the last two triangles were in patches.
    last: [bool; 2],
    /// Sixteenths of the outer predictor.
    outer: i64,
    new_vertices: u32,
}

impl LevelCoder {
    pub(super) fn new(surface: &Surface, rows: &Rows, new_vertices: u32, outer: i64) -> Self {
        let mut valences = vec![0u8; surface.corner_of.len()];
        surface.triangles.iter().flatten().for_each(|&v| valences[v as usize] = valences[v as usize].saturating_add(1));
        let regions = surface.triangles.iter().enumerate().map(|(t, &shared)| Region { parent: t as u32, size: 1, shared });
        Self {
            stage: Stage::Order,
            order: CanonicalOrder::default(),
            members: vec![Membership::Unknown; surface.triangles.len()],
            regions: regions.collect(),
            at: 0,
            patches: Vec::new(),
            patch_of_root: vec![NONE; surface.triangles.len()],
            valences,
            areas: areas(surface, rows),
            last: [false; 2],
            outer,
            new_vertices,
        }
    }

    /// Goes on by about `limit` triangles or vertices; true once the level is whole. `inserted` gets what it brings.
    pub(super) fn step(
        &mut self,
        coder: &mut impl Coder,
        model: &mut LevelModel,
        (surface, rows): (&mut Surface, &mut Rows),
        mut truth: Option<&mut LevelTruth>,
        limit: usize,
        inserted: &mut Vec<Inserted>,
    ) -> Result<bool, &'static str> {
        match self.stage {
            Stage::Order => {
                if self.order.step(surface, limit) {
                    self.stage = Stage::Patches;
                }
            }
            Stage::Patches => {
                let end = self.at.saturating_add(limit).min(self.order.order.len());
                for i in self.at..end {
                    let t = self.order.order[i];
                    self.triangle(coder, model, surface, t, truth.as_deref().map(|truth| truth.vertex));
                }
                self.at = end;
                if end == self.order.order.len() {
                    self.begin_vertices()?;
                }
            }
            Stage::Vertices => {
                let end = self.at.saturating_add(limit).min(self.patches.len());
                for i in self.at..end {
                    let patch = std::mem::take(&mut self.patches[i]);
                    let fan = surface.fan(&patch).ok_or("triangles that make no patch")?;
                    inserted.push(self.vertex(coder, model, surface, rows, truth.as_deref_mut(), &fan));
                }
                self.at = end;
                return Ok(end == self.patches.len());
            }
        }
        Ok(false)
    }

    /// A step that ends with the patches; true while they are not all coded.
    pub(super) fn step_patches(
        &mut self,
        coder: &mut impl Coder,
        model: &mut LevelModel,
        mesh: (&mut Surface, &mut Rows),
        truth: &mut LevelTruth,
    ) -> Result<bool, &'static str> {
        if matches!(self.stage, Stage::Vertices) {
            return Ok(false);
        }
        self.step(coder, model, mesh, Some(truth), usize::MAX, &mut Vec::new())?;
        Ok(true)
    }

    /// All patches are known: in order.
    fn begin_vertices(&mut self) -> Result<(), &'static str> {
        for i in 0..self.order.order.len() {
            let t = self.order.order[i];
            if self.members[t as usize] != Membership::Inside {
                continue;
            }
            let root = root(&mut self.regions, t) as usize;
            if self.patch_of_root[root] == NONE {
                self.patch_of_root[root] = self.patches.len() as u32;
                self.patches.push(Vec::new());
            }
            self.patches[self.patch_of_root[root] as usize].push(t);
        }
        if self.patches.len() as u32 != self.new_vertices {
            return Err("another number of patches than the table announces");
        }
        self.stage = Stage::Vertices;
        self.at = 0;
        Ok(())
    }

    /// Codes which patch triangle `t` is in; `vertex` is the encoder's knowledge.
    fn triangle(&mut self, coder: &mut impl Coder, model: &mut LevelModel, surface: &Surface, t: u32, vertex: Option<&[u32]>) {
        let corners = surface.triangles[t as usize];
        let neighbours = [0, 1, 2].map(|k| match surface.across[3 * t as usize + k] {
            NONE => (Membership::Unknown, NONE),
            c => (self.members[c as usize / 3], c / 3),
        });
        let unknown = neighbours.iter().filter(|n| n.0 == Membership::Unknown && n.1 != NONE).count();
        let out = neighbours.iter().filter(|n| n.0 == Membership::Outside).count();
        // 3 and below to 10 and above.
        let valence = |v: u32| usize::from(self.valences[v as usize]).clamp(3, 10) - 3;
        let mut valences = corners.map(valence);
        valences.sort_unstable();
        let [low, middle, high] = valences;
        let area = usize::from(self.areas[t as usize]);
        let mut own = Region { parent: t, size: 1, shared: corners };
        let mut joined = false;
        for k in 0..3 {
            let (member, n) = neighbours[k];
            if member != Membership::Inside {
                continue;
            }
            let other_root = root(&mut self.regions, n);
            let other = self.regions[other_root as usize];
            if joined && other_root == root(&mut self.regions, t) {
                continue;
            }
            let shared = own.shared.map(|v| if other.shared.contains(&v) { v } else { NONE });
            if shared == [NONE; 3] {
                continue;
            }
            // The apex has gained triangles, the rim has lost some.
            let apex = shared.iter().filter(|&&v| v != NONE).map(|&v| valence(v)).max().unwrap_or(0);
            let (x, y) = (valence(corners[k]), valence(corners[(k + 1) % 3]));
            let (beside, third) = (x.min(y), valence(corners[(k + 2) % 3]));
            let far = usize::from(self.areas[n as usize]);
            let size = other.size as usize;
            let contexts = [
                [size, unknown, out],
                [apex, beside, usize::from(size > 1)],
                [size, apex, third],
                [area, far, size.min(3) + 4 * usize::from(joined)],
                [third, unknown, size],
                [apex, beside, third],
            ];
            let same = vertex.is_some_and(|v| v[n as usize] == v[t as usize]);
            if model.join.code(coder, if joined { 0 } else { size }, contexts, same) {
                self.regions[other_root as usize].parent = t;
                own = Region { parent: t, size: own.size + other.size, shared };
                self.regions[t as usize] = own;
                joined = true;
            }
        }
        let inside = joined || {
            let (last, before) = (usize::from(self.last[0]), usize::from(self.last[1]));
            let begun = neighbours.iter().filter(|n| n.0 == Membership::Inside).count();
            let contexts = [
                [out, begun, unknown],
                [high, low, middle],
                [area, out, begun],
                [high, middle, unknown],
                [last * 2 + before, out, unknown],
                [high, low, area],
            ];
            model.begin.code(coder, out, contexts, vertex.is_some_and(|v| v[t as usize] != NONE))
        };
        self.members[t as usize] = if inside { Membership::Inside } else { Membership::Outside };
        self.last = [inside, self.last[0]];
    }

    /// Codes the vertex of a patch and puts it in.
    fn vertex(
        &self,
        coder: &mut impl Coder,
        model: &mut LevelModel,
        surface: &mut Surface,
        rows: &mut Rows,
        truth: Option<&mut LevelTruth>,
        fan: &Fan,
    ) -> Inserted {
        let (predicted, scale) = predict(surface, rows, fan, self.outer);
        let first = fan.corners[0] / 3;
        let wanted = truth.as_deref().map(|t| t.vertex[first as usize]);
        let own = truth.as_deref().zip(wanted).map(|(t, w)| t.rows.row(w));
        model.rows.code(coder, rows, own, &predicted, scale);
        if let Some((t, w)) = truth.zip(wanted) {
            t.vertex_order.push(w);
        }
        let vertex = surface.insert(fan);
        let moves = fan.corners.iter().map(|&c| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex });
        let n = surface.triangles.len();
        let triangles = [surface.triangles[n - 2], surface.triangles[n - 1]];
        Inserted { vertex, apex: fan.apex, corner_moves: moves.collect(), triangles }
    }
}

fn root(regions: &mut [Region], mut t: u32) -> u32 {
    while regions[t as usize].parent != t {
        let up = regions[t as usize].parent;
        regions[t as usize].parent = regions[up as usize].parent;
        t = up;
    }
    t
}

/// Classes of the triangles' areas: half powers of two about the mean. Exponents of floats stand for logarithms, which are not
/// the same on every machine.
fn areas(surface: &Surface, rows: &Rows) -> Vec<u8> {
    let squared = |t: &[u32; 3]| {
        let p = t.map(|v| [0, 1, 2].map(|k| rows.value(v, k) as f64));
        let edge = |i: usize| [0, 1, 2].map(|k| p[i][k] - p[0][k]);
        let (a, b) = (edge(1), edge(2));
        let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + 1.0
    };
    let exponent = |x: f64| (x.to_bits() >> 52) as i64;
    let all: Vec<i64> = surface.triangles.iter().map(|t| exponent(squared(t))).collect();
    let mean = all.iter().sum::<i64>() / all.len().max(1) as i64;
    all.into_iter().map(|e| (e - mean + 4).clamp(0, CLASSES as i64 - 1) as u8).collect()
}

/// Where a patch's vertex is expected: the mean of the hole's rim (C.4), moved away from the mean of what lies beyond the rim
/// by `outer` sixteenths of the distance; and the rim's size.
pub(super) fn predict(surface: &Surface, rows: &Rows, fan: &Fan, outer: i64) -> (Vec<i64>, i64) {
    let rim = || std::iter::once(fan.apex).chain(fan.chain.iter().copied());
    let count = fan.chain.len() as i64 + 1;
    let first = fan.corners[0];
    let last = fan.corners[fan.corners.len() - 1];
    let edges = std::iter::once(first).chain(fan.corners.iter().map(|&c| super::surface::next(c)));
    let edges = edges.chain(std::iter::once(super::surface::previous(last)));
    let beyond: Vec<u32> = edges
        .filter_map(|c| match surface.across[c as usize] {
            NONE => None,
            other => Some(surface.vertex(super::surface::previous(other))),
        })
        .collect();
    let mut scale = 0;
    let predicted = (0..rows.width)
        .map(|k| {
            let sum: i64 = rim().map(|v| rows.value(v, k)).sum();
            let mean = (sum * 2 + count).div_euclid(2 * count);
            if k >= 3 {
                return mean;
            }
            scale += rim().map(|v| (rows.value(v, k) - mean).abs()).sum::<i64>();
            let n = beyond.len() as i64;
            if n == 0 || outer == 0 {
                return mean;
            }
            let far: i64 = beyond.iter().map(|&v| rows.value(v, k)).sum();
            // mean + outer / 16 (mean - far / n), rounded.
            let (top, bottom) = (16 * mean * n + outer * (mean * n - far), 16 * n);
            (2 * top + bottom).div_euclid(2 * bottom)
        })
        .collect();
    (predicted, scale / count)
}
