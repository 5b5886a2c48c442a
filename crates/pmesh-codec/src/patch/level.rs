//! One level: the patches of the coarser mesh, then a vertex for each patch (C.5, C.6).
//!
//! Each triangle in canonical order is coded by what is known of its neighbours: whether it goes on a patch that has begun
//! there (never where no fan would come of it), else whether it begins one. That is what colours say, without their names:
//! which of three colours a patch has costs more than a bit a vertex and tells a decoder nothing.

use crate::range::{Coder, RangeDecoder};
use crate::refine::Levels;
use crate::refine::question::{CLASSES, Question};
use crate::refine::rows::{RowModel, Rows};
use pmesh_core::surface::{CanonicalOrder, Fan, NONE, Surface, next, previous};
use pmesh_core::{CornerMove, Level};

/// What is known of a triangle.
#[derive(Clone, Copy, PartialEq)]
enum Membership {
    Unknown,
    /// In no patch.
    Outside,
    Inside,
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
    /// Valences, areas, a region for each triangle.
    Look,
    Order,
    Patches,
    /// Patches in the order of their first triangles.
    Gather,
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
    /// First and last triangle of each patch, and the next one of each triangle's patch.
    patches: Vec<(u32, u32)>,
    next: Vec<u32>,
    /// Patch of each triangle that is a region's root.
    patch_of_root: Vec<u32>,
    valences: Vec<u8>,
    /// Size of each triangle's area, and their sum.
    areas: Vec<i16>,
    area_sum: i64,
    /// Whether the last two triangles were in patches.
    last: [bool; 2],
    /// Sixteenths of the outer predictor.
    outer: i64,
    new_vertices: u32,
}

impl LevelCoder {
    pub(super) fn new(new_vertices: u32, outer: i64) -> Self {
        Self {
            stage: Stage::Look,
            order: CanonicalOrder::default(),
            members: Vec::new(),
            regions: Vec::new(),
            at: 0,
            patches: Vec::new(),
            next: Vec::new(),
            patch_of_root: Vec::new(),
            valences: Vec::new(),
            areas: Vec::new(),
            area_sum: 0,
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
            Stage::Look => {
                self.valences.resize(surface.corner_of.len(), 0);
                let end = self.at.saturating_add(limit).min(surface.triangles.len());
                for t in self.at..end {
                    self.look(surface.triangles[t], t as u32, rows);
                }
                self.at = end;
                if end == surface.triangles.len() {
                    self.stage = Stage::Order;
                    self.at = 0;
                }
            }
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
                    self.stage = Stage::Gather;
                    self.at = 0;
                }
            }
            Stage::Gather => {
                let end = self.at.saturating_add(limit).min(self.order.order.len());
                (self.at..end).for_each(|i| self.gather(self.order.order[i]));
                self.at = end;
                if end == self.order.order.len() {
                    if self.patches.len() as u32 != self.new_vertices {
                        return Err("another number of patches than the table announces");
                    }
                    self.stage = Stage::Vertices;
                    self.at = 0;
                }
            }
            Stage::Vertices => {
                let end = self.at.saturating_add(limit).min(self.patches.len());
                for i in self.at..end {
                    let (mut t, last) = self.patches[i];
                    let mut patch = vec![t];
                    while t != last {
                        t = self.next[t as usize];
                        patch.push(t);
                    }
                    let fan = surface.fan(&patch).ok_or("triangles that make no patch")?;
                    inserted.push(self.vertex(coder, model, surface, rows, truth.as_deref_mut(), &fan));
                }
                self.at = end;
                return Ok(end == self.patches.len());
            }
        }
        Ok(false)
    }

    /// True once all patches are coded: what follows are displacements.
    pub(super) fn patches_are_coded(&self) -> bool {
        matches!(self.stage, Stage::Gather | Stage::Vertices)
    }

    /// What is known of a triangle before anything is coded.
    fn look(&mut self, corners: [u32; 3], t: u32, rows: &Rows) {
        corners.iter().for_each(|&v| self.valences[v as usize] = self.valences[v as usize].saturating_add(1));
        self.regions.push(Region { parent: t, size: 1, shared: corners });
        self.members.push(Membership::Unknown);
        self.next.push(NONE);
        self.patch_of_root.push(NONE);
        let p = corners.map(|v| [0, 1, 2].map(|k| rows.value(v, k) as f64));
        let edge = |i: usize| [0, 1, 2].map(|k| p[i][k] - p[0][k]);
        let (a, b) = (edge(1), edge(2));
        let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + 1.0;
        // The exponent stands for the logarithm, which is not the same on every machine.
        let size = (squared.to_bits() >> 52) as i16;
        self.areas.push(size);
        self.area_sum += i64::from(size);
    }
    /// Class of a triangle's area: half powers of two about the mean.
    fn area(&self, t: u32) -> usize {
        let mean = self.area_sum / self.areas.len().max(1) as i64;
        (i64::from(self.areas[t as usize]) - mean + 4).clamp(0, CLASSES as i64 - 1) as usize
    }

    fn gather(&mut self, t: u32) {
        if self.members[t as usize] != Membership::Inside {
            return;
        }
        let root = root(&mut self.regions, t) as usize;
        match self.patch_of_root[root] {
            NONE => {
                self.patch_of_root[root] = self.patches.len() as u32;
                self.patches.push((t, t));
            }
            patch => {
                let last = &mut self.patches[patch as usize].1;
                self.next[*last as usize] = t;
                *last = t;
            }
        }
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
        let area = self.area(t);
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
            let far = self.area(n);
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

/// The decoder's side: a model that outlives levels, and the level that is being decoded.
#[derive(Default)]
pub(super) struct PatchLevels {
    model: Option<LevelModel>,
    level: Option<Box<LevelCoder>>,
}

impl Levels for PatchLevels {
    fn begin(&mut self, bytes: &mut Vec<u8>, new_vertices: u32, width: usize) -> bool {
        if bytes.first().is_none_or(|&outer| outer > 16) {
            return false;
        }
        self.model.get_or_insert_with(|| LevelModel::new(width));
        self.level = Some(Box::new(LevelCoder::new(new_vertices, i64::from(bytes.remove(0)))));
        true
    }
    fn step(
        &mut self,
        coder: &mut RangeDecoder,
        surface: &mut Surface,
        rows: &mut Rows,
        limit: usize,
        part: &mut Level,
    ) -> Result<bool, &'static str> {
        let (Some(level), Some(model)) = (&mut self.level, &mut self.model) else { return Ok(true) };
        let mut inserted = Vec::new();
        let done = level.step(coder, model, (surface, rows), None, limit, &mut inserted)?;
        for i in inserted {
            part.representatives.push((i.vertex, i.apex));
            part.corner_moves.extend(i.corner_moves);
            part.triangles.extend(i.triangles);
        }
        Ok(done)
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

/// Where a patch's vertex is expected: the mean of the hole's rim (C.4), moved away from the mean of what lies beyond the rim
/// by `outer` sixteenths of the distance; and the rim's size.
pub(super) fn predict(surface: &Surface, rows: &Rows, fan: &Fan, outer: i64) -> (Vec<i64>, i64) {
    let rim = || std::iter::once(fan.apex).chain(fan.chain.iter().copied());
    let count = fan.chain.len() as i64 + 1;
    let first = fan.corners[0];
    let last = fan.corners[fan.corners.len() - 1];
    let edges = std::iter::once(first).chain(fan.corners.iter().map(|&c| next(c)));
    let edges = edges.chain(std::iter::once(previous(last)));
    let beyond: Vec<u32> = edges
        .filter_map(|c| match surface.across[c as usize] {
            NONE => None,
            other => Some(surface.vertex(previous(other))),
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
