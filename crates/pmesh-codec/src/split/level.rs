//! One split: the marks of the edges, then tree by tree the cut and the triangles, then where the new vertices stand.

use super::TREE_LIMIT;
use super::tree::{Opened, Side, Star, cut, fill, ring, star, walk};
use crate::range::{Coder, RangeDecoder};
use crate::refine::Levels;
use crate::refine::question::{CLASSES, Question};
use crate::refine::rows::{RowModel, Rows};
use pmesh_core::Level;
use pmesh_core::surface::{CanonicalOrder, NONE, Surface, next, previous};
use std::collections::{HashMap, VecDeque};

/// Neighbours that may be unknown are told apart up to there.
const ROW_MODELS: usize = 4;
/// Neighbours that a prediction looks at.
const RING_LIMIT: usize = 24;

/// Chances that go on learning from level to level.
pub(super) struct SplitModel {
    mark: Question,
    join: Question,
    keep: Question,
    /// By the number of neighbours that are not known.
    rows: [RowModel; ROW_MODELS],
}

impl SplitModel {
    pub(super) fn new(width: usize) -> Self {
        let (mark, join, keep) = (Question::new(), Question::new(), Question::new());
        Self { mark, join, keep, rows: std::array::from_fn(|_| RowModel::new(width)) }
    }
}

/// What the encoder knows. Vertices of the finer level go by their numbers in the mesh.
pub(super) struct SplitTruth<'a> {
    /// By corner of the coarser mesh: is its edge in the forest?
    pub(super) marked: &'a [bool],
    /// By triangle of the coarser mesh: its corners in the finer one.
    pub(super) finer: &'a [[u32; 3]],
    /// Triangles that the split brings: the third vertex of the one that has a directed edge.
    pub(super) third: &'a HashMap<(u32, u32), u32>,
    pub(super) rows: &'a Rows,
    /// Vertices in the order in which they are coded.
    pub(super) vertex_order: &'a mut Vec<u32>,
}

enum Stage {
    Triangles,
    Vertices,
    Order,
    Marks,
    Trees,
    Places,
}

/// Raw cost: questions that were asked, for a bit each would do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Asked {
    pub(super) marks: u64,
    pub(super) joins: u64,
    pub(super) keeps: u64,
}

/// The coder of either direction, in steps.
pub(super) struct SplitCoder {
    stage: Stage,
    at: usize,
    order: CanonicalOrder,
    /// By triangle: its edges have been asked for.
    asked: Vec<bool>,
    /// By vertex: triangles around it, marked edges, edges that were not asked for yet.
    valences: Vec<u32>,
    marks: Vec<u8>,
    stars: Vec<Star>,
    /// Place among the vertices of the tree that is being cut, or [`NONE`].
    slots: Vec<u32>,
    /// Union-find forest of vertices, and edges of each tree at its root.
    parents: Vec<u32>,
    sizes: Vec<u32>,
    /// By corner.
    marked: Vec<bool>,
    /// Corners at which trees are looked for, in the order of the marks.
    starts: Vec<u32>,
    lengths: i64,
    opened: VecDeque<Opened>,
    /// New vertices with their representatives.
    inserted: Vec<(u32, u32)>,
    last: bool,
    new_vertices: u32,
    pub(super) count: Asked,
}

impl SplitCoder {
    pub(super) fn new(new_vertices: u32) -> Self {
        Self {
            stage: Stage::Triangles,
            at: 0,
            order: CanonicalOrder::default(),
            asked: Vec::new(),
            valences: Vec::new(),
            marks: Vec::new(),
            stars: Vec::new(),
            slots: Vec::new(),
            parents: Vec::new(),
            sizes: Vec::new(),
            marked: Vec::new(),
            starts: Vec::new(),
            lengths: 0,
            opened: VecDeque::new(),
            inserted: Vec::new(),
            last: false,
            new_vertices,
            count: Asked::default(),
        }
    }

    /// True once all of the surface is coded: what follows are places.
    pub(super) fn surface_is_coded(&self) -> bool {
        matches!(self.stage, Stage::Places)
    }

    /// Goes on by about `limit` triangles or vertices; true once the level is whole. `part` gets what it brings, vertices left
    /// out.
    pub(super) fn step(
        &mut self,
        coder: &mut impl Coder,
        model: &mut SplitModel,
        (surface, rows): (&mut Surface, &mut Rows),
        mut truth: Option<&mut SplitTruth>,
        limit: usize,
        part: &mut Level,
    ) -> Result<bool, &'static str> {
        let vertices = surface.corner_of.len();
        let end = |at: usize, all: usize| at.saturating_add(limit).min(all);
        let (until, then) = match self.stage {
            Stage::Triangles => {
                self.valences.resize(vertices, 0);
                let until = end(self.at, surface.triangles.len());
                for corners in &surface.triangles[self.at..until] {
                    corners.iter().for_each(|&v| self.valences[v as usize] += 1);
                    self.lengths += length(rows, corners[0], corners[1]);
                }
                self.asked.resize(until, false);
                self.marked.resize(3 * until, false);
                (until, (until == surface.triangles.len()).then_some(Stage::Vertices))
            }
            Stage::Vertices => {
                let until = end(self.at, vertices);
                for v in self.at..until {
                    self.stars.push(star(surface, v as u32, self.valences[v]));
                    self.parents.push(v as u32);
                    self.sizes.push(0);
                    self.marks.push(0);
                    self.slots.push(NONE);
                }
                (until, (until == vertices).then_some(Stage::Order))
            }
            Stage::Order => (0, self.order.step(surface, limit).then_some(Stage::Marks)),
            Stage::Marks => {
                let until = end(self.at, self.order.order.len());
                for i in self.at..until {
                    self.marks_of(coder, model, surface, rows, self.order.order[i], truth.as_deref());
                }
                (until, (until == self.order.order.len()).then_some(Stage::Trees))
            }
            Stage::Trees => {
                let (mut until, mut done) = (self.at, 0);
                while until < self.starts.len() && done <= limit {
                    done += self.tree(coder, model, surface, rows.count(), self.starts[until], truth.as_deref_mut())?;
                    until += 1;
                }
                let over = until == self.starts.len();
                if over && surface.corner_of.len() as u64 != u64::from(rows.count()) + u64::from(self.new_vertices) {
                    return Err("another number of vertices than the table announces");
                }
                (until, over.then_some(Stage::Places))
            }
            Stage::Places => {
                let stop = rows.count().saturating_add(limit.min(u32::MAX as usize) as u32).min(vertices as u32);
                while rows.count() < stop {
                    let pair = self.place(coder, model, surface, rows, truth.as_deref());
                    part.representatives.push(pair);
                }
                self.release(surface, rows.count(), part);
                return Ok(rows.count() == vertices as u32);
            }
        };
        self.at = until;
        if let Some(stage) = then {
            self.stage = stage;
            self.at = 0;
        }
        Ok(false)
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.parents[v as usize] != v {
            let up = self.parents[v as usize];
            self.parents[v as usize] = self.parents[up as usize];
            v = up;
        }
        v
    }

    /// The marks of a triangle's edges, of those that were not asked for at the triangle across.
    fn marks_of(
        &mut self,
        coder: &mut impl Coder,
        model: &mut SplitModel,
        surface: &Surface,
        rows: &Rows,
        t: u32,
        truth: Option<&SplitTruth>,
    ) {
        self.asked[t as usize] = true;
        for c in 3 * t..3 * t + 3 {
            let other = surface.across[c as usize];
            if other == NONE || self.asked[other as usize / 3] {
                continue;
            }
            let (a, b) = (surface.vertex(c), surface.vertex(next(c)));
            // No tree goes where walks miss triangles, nor along an edge between two vertices of the boundary.
            match (self.stars[a as usize], self.stars[b as usize]) {
                (Star::Broken, _) | (_, Star::Broken) | (Star::Open, Star::Open) => continue,
                _ => {}
            }
            let (root_a, root_b) = (self.root(a), self.root(b));
            let size = self.sizes[root_a as usize] + self.sizes[root_b as usize] + 1;
            if root_a == root_b || size > TREE_LIMIT {
                continue;
            }
            self.count.marks += 1;
            let (x, y) = (surface.vertex(previous(c)), surface.vertex(previous(other)));
            let marks = |v: u32| usize::from(self.marks[v as usize]);
            let valence = |v: u32| (self.valences[v as usize] as usize).clamp(3, 10) - 3;
            let sides = [next(c), previous(c), next(other), previous(other)];
            let near: usize = sides.iter().filter(|&&s| self.marked[s as usize]).count();
            let (low, high) = (marks(a).min(marks(b)), marks(a).max(marks(b)));
            let (beside, across) = (marks(x) + marks(y), usize::from(marks(x) > 0) + usize::from(marks(y) > 0));
            let mean = self.lengths / self.asked.len().max(1) as i64;
            let long = (length(rows, a, b) - mean + 4).clamp(0, CLASSES as i64 - 1) as usize;
            let tree = |v: u32| (32 - self.sizes[v as usize].leading_zeros()) as usize / 2;
            let ends = usize::from(self.asked_fan(surface, c)) + 2 * usize::from(self.asked_fan(surface, next(c)));
            let contexts = [
                [low, high, ends],
                [near, across, low.min(1) * 4 + high.min(3)],
                [valence(a).min(valence(b)), valence(a).max(valence(b)), low.min(1) + high.min(1) + 3 * usize::from(self.last)],
                [long, high, ends],
                [tree(root_a).min(tree(root_b)), tree(root_a).max(tree(root_b)), near],
                [beside, valence(x).max(valence(y)), ends + 4 * usize::from(self.last)],
            ];
            let bit = model.mark.code(
                coder,
                low.min(1) + high.min(1) + 3 * across.min(1),
                contexts,
                truth.is_some_and(|t| t.marked[c as usize]),
            );
            self.last = bit;
            if bit {
                self.parents[root_b as usize] = root_a;
                self.sizes[root_a as usize] = size;
                (self.marked[c as usize], self.marked[other as usize]) = (true, true);
                for v in [a, b] {
                    self.marks[v as usize] = self.marks[v as usize].saturating_add(1);
                }
                self.starts.push(c);
            }
        }
    }
    /// True if the triangles on either side of the corner's own were asked already: its vertex has not many edges left.
    fn asked_fan(&self, surface: &Surface, c: u32) -> bool {
        let there = |c: u32| c != NONE && self.asked[c as usize / 3];
        there(surface.turn(c)) || there(surface.turn_back(c))
    }

    /// Cuts and fills the tree of a marked corner, if that is still to be done. Gives its sides.
    fn tree(
        &mut self,
        coder: &mut impl Coder,
        model: &mut SplitModel,
        surface: &mut Surface,
        known: u32,
        start: u32,
        mut truth: Option<&mut SplitTruth>,
    ) -> Result<usize, &'static str> {
        if !self.marked[start as usize] {
            return Ok(0);
        }
        let sides = walk(surface, &self.marked, start, 2 * TREE_LIMIT as usize).ok_or("a tree without end")?;
        sides.iter().for_each(|s| self.marked[s.corner as usize] = false);
        let finer: Vec<u32> = match truth.as_deref() {
            Some(t) => sides.iter().map(|s| t.finer[s.first as usize / 3][s.first as usize % 3]).collect(),
            None => Vec::new(),
        };
        let stays = |i: usize| truth.as_deref().is_some_and(|t| t.vertex_order[sides[i].vertex as usize] == finer[i]);
        let keeps = self.keepers(coder, model, &sides, stays);
        let mut opened = Opened { first_triangle: surface.triangles.len() as u32, ..Default::default() };
        let copies = cut(surface, &sides, &keeps, &mut opened);
        if surface.corner_of.len() as u64 > u64::from(known) + u64::from(self.new_vertices) {
            return Err("more vertices than the table announces");
        }
        let third = truth.as_deref().map(|t| t.third);
        let degree = |i: usize| usize::from(self.marks[sides[i].vertex as usize]);
        let mut asked = 0;
        fill(surface, &sides, &copies, |[a, b, c, d], depth| {
            let [va, vb, vc, vd] = [a, b, c, d].map(|i| sides[i].vertex);
            let shape = usize::from(va == vb) + 2 * usize::from(vb == vc) + 4 * usize::from(va == vc);
            let after = usize::from(vd == va) + 2 * usize::from(vd == vb) + 4 * usize::from(vd == vc);
            let single = usize::from(b == a + 1) + 2 * usize::from(c == b + 1);
            let contexts = [
                [shape, after, single],
                [shape, after, depth],
                [shape, degree(a), degree(b)],
                [shape, degree(b), degree(c)],
                [shape + usize::from(vd == vb), degree(c), degree(d)],
                [single, depth, after],
            ];
            let truth = third.is_some_and(|t| t.get(&(finer[b], finer[a])) == Some(&finer[c]));
            asked += 1;
            model.join.code(coder, shape, contexts, truth)
        })?;
        self.count.joins += asked;
        if let Some(t) = &mut truth {
            t.vertex_order.extend(finer.iter().zip(&keeps).filter(|k| !k.1).map(|k| *k.0));
        }
        self.inserted.extend_from_slice(&opened.vertices);
        self.opened.push_back(opened);
        Ok(sides.len())
    }

    /// Which copies keep their vertex's number and place: one of each vertex, the one at a boundary where there is one.
    fn keepers(
        &mut self,
        coder: &mut impl Coder,
        model: &mut SplitModel,
        sides: &[Side],
        stays: impl Fn(usize) -> bool,
    ) -> Vec<bool> {
        /// What is known of a vertex's copies: how many are to come, how many there are, their triangles, and whether one stays.
        struct Copies {
            left: usize,
            all: usize,
            triangles: u32,
            open: bool,
            settled: bool,
        }
        // By vertex of the tree, in the order of their first copies.
        let mut copies: Vec<Copies> = Vec::with_capacity(sides.len());
        for s in sides {
            let slot = &mut self.slots[s.vertex as usize];
            if *slot == NONE {
                *slot = copies.len() as u32;
                copies.push(Copies { left: 0, all: 0, triangles: 0, open: false, settled: false });
            }
            let c = &mut copies[*slot as usize];
            c.left += 1;
            c.all += 1;
            c.triangles += s.count;
            c.open |= s.open;
        }
        let mut keeps = Vec::with_capacity(sides.len());
        for (i, s) in sides.iter().enumerate() {
            let c = &mut copies[self.slots[s.vertex as usize] as usize];
            let keep = if c.open {
                s.open
            } else if c.settled || c.left == 1 {
                !c.settled
            } else {
                self.count.keeps += 1;
                let share = (4 * s.count as usize * c.all / c.triangles.max(1) as usize).min(CLASSES - 1);
                let (count, left) = (s.count as usize, c.left);
                let contexts = [
                    [left, share, 0],
                    [left, count, 1],
                    [c.all, count, left],
                    [c.all, c.triangles as usize / 2, count],
                    [share, count, 4],
                    [left, c.triangles as usize / 2, 5],
                ];
                model.keep.code(coder, left, contexts, stays(i))
            };
            c.settled |= keep;
            c.left -= 1;
            keeps.push(keep);
        }
        sides.iter().for_each(|s| self.slots[s.vertex as usize] = NONE);
        keeps
    }

    /// Codes the next new vertex; gives it and its representative.
    fn place(
        &self,
        coder: &mut impl Coder,
        model: &mut SplitModel,
        surface: &Surface,
        rows: &mut Rows,
        truth: Option<&SplitTruth>,
    ) -> (u32, u32) {
        let v = rows.count();
        let representative = self.representative(v);
        let (predicted, scale, missing) = predict(surface, rows, v, representative);
        let own = truth.map(|t| t.rows.row(t.vertex_order[v as usize]));
        model.rows[missing.min(ROW_MODELS - 1)].code(coder, rows, own, &predicted, scale);
        (v, representative)
    }
    fn representative(&self, v: u32) -> u32 {
        self.inserted.first().and_then(|first| self.inserted.get((v - first.0) as usize)).map_or(0, |p| p.1)
    }

    /// Gives out the trees whose vertices are all known.
    fn release(&mut self, surface: &Surface, known: u32, part: &mut Level) {
        while let Some(o) = self.opened.pop_front() {
            if o.vertices.last().is_some_and(|v| v.0 >= known) {
                self.opened.push_front(o);
                return;
            }
            let count = 2 * o.vertices.len();
            part.triangles.extend_from_slice(&surface.triangles[o.first_triangle as usize..][..count]);
            part.corner_moves.extend(o.corner_moves);
        }
    }
}

/// Twice the logarithm of an edge's length, about; the exponent stands for it, which is the same on every machine.
fn length(rows: &Rows, a: u32, b: u32) -> i64 {
    let squared: f64 = (0..3).map(|k| ((rows.value(a, k) - rows.value(b, k)) as f64).powi(2)).sum();
    ((squared + 1.0).to_bits() >> 52) as i64
}

/// Where a new vertex is expected: amid the neighbours that are known; the neighbourhood's size; and how many are not known.
fn predict(surface: &Surface, rows: &Rows, v: u32, representative: u32) -> (Vec<i64>, i64, usize) {
    let known = rows.count();
    let (mut near, mut missing) = (Vec::with_capacity(8), 0);
    ring(surface, surface.corner_of[v as usize], RING_LIMIT, |n| if n < known { near.push(n) } else { missing += 1 });
    if near.is_empty() {
        near.push(representative);
    }
    let count = near.len() as i64;
    let mut scale = 0;
    let predicted = (0..rows.width)
        .map(|k| {
            let sum: i64 = near.iter().map(|&v| rows.value(v, k)).sum();
            let mean = (sum * 2 + count).div_euclid(2 * count);
            if k < 3 {
                scale += near.iter().map(|&v| (rows.value(v, k) - mean).abs()).sum::<i64>();
            }
            mean
        })
        .collect();
    (predicted, scale / count, missing)
}

/// The decoder's side: a model that outlives levels, and the level that is being decoded.
#[derive(Default)]
pub(super) struct SplitLevels {
    model: Option<SplitModel>,
    level: Option<Box<SplitCoder>>,
}

impl Levels for SplitLevels {
    fn begin(&mut self, _: &mut Vec<u8>, new_vertices: u32, width: usize) -> bool {
        self.model.get_or_insert_with(|| SplitModel::new(width));
        self.level = Some(Box::new(SplitCoder::new(new_vertices)));
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
        level.step(coder, model, (surface, rows), None, limit, part)
    }
}
