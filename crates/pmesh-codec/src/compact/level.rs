//! One level: vertex by vertex, whether it splits, how, and where the new vertex stands.

use super::arrival::Fresh;
use super::mixer::Mixer;
use super::options::{Center, Neighbour, Seam, Side, VALENCE_LIMIT, Way, WayModel, Ways};
use super::place::{PlaceModel, Star};
use super::vector::{Vector, add, cross, length, scale, sub};
use crate::pmesh::varint::Reader;
use crate::range::{Coder, NumberModel, RangeDecoder, SignedModel};
use crate::refine::Levels;
use crate::refine::rows::Rows;
use crate::refine::surface::{Fan, NONE, Surface, next, previous};
use pmesh_core::{CornerMove, Level};
use std::collections::HashMap;

/// Values of the contexts of "does it split?".
const BINS: usize = 16;
const FLAGS: usize = 7;

/// What goes on being learnt from level to level.
pub(super) struct LevelModel {
    flag: Mixer<FLAGS>,
    ways: WayModel,
    pub(super) place: PlaceModel,
    pub(super) attributes: Vec<SignedModel>,
    /// Which new vertex shares the position, by how many there are to share with.
    pub(super) link: [NumberModel; 4],
    pub(super) levels: usize,
}

impl LevelModel {
    pub(super) fn new(width: usize) -> Self {
        let sizes = [BINS * BINS * 12, 16 * 16 * 3, BINS * 8 * 3, 6 * 16 * 6, 18 * 6 * 4, BINS * 5 * 6, 18 * 8 * 6];
        Self {
            flag: Mixer::new(sizes, 3 * 4, 0.5 / 3.0, 0.5),
            ways: WayModel::new(),
            place: PlaceModel::new(),
            attributes: (3..width).map(|_| SignedModel::default()).collect(),
            link: Default::default(),
            levels: 0,
        }
    }
}

/// A split that the encoder knows of, in coded numbers.
#[derive(Clone, Debug)]
pub(super) struct Split {
    /// Number in the mesh.
    pub(super) vertex: u32,
    pub(super) side: Side,
    pub(super) chain: Vec<u32>,
}

/// What the encoder knows.
pub(super) struct LevelTruth<'a> {
    /// By coded vertex: what it splits into.
    pub(super) splits: &'a mut [Vec<Split>],
    pub(super) rows: &'a Rows,
    pub(super) vertex_order: &'a mut Vec<u32>,
    /// For each vertex of the mesh the one whose position it shares, or [`NONE`].
    pub(super) position_of: &'a [u32],
}

/// Bits that the levels take, by what they say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    /// Which vertices split.
    pub flags: f64,
    /// Which triangles go to the new vertices, and which of those share positions.
    pub ways: f64,
    /// Where the new vertices stand.
    pub places: f64,
    /// Their attributes.
    pub attributes: f64,
}

/// The coder of either direction, in steps.
pub(super) struct LevelCoder {
    /// Most bytes that a vertex takes: announced to a decoder, found by an encoder.
    pub(super) reach: usize,
    /// Vertices before the level, and after.
    start: usize,
    end: usize,
    at: usize,
    looked: usize,
    /// By vertex: corners of triangles there, kept up to date; mean edge length and normal as the level found them, of a new vertex
    /// those of what it split from and of its ring.
    pub(super) counts: Vec<u32>,
    pub(super) edges: Vec<f32>,
    pub(super) normals: Vec<[f32; 3]>,
    /// By vertex of the coarser mesh: its triangles are one fan, and not too many; others never split.
    whole: Vec<bool>,
    pub(super) mean_edge: f64,
    counted: bool,
    ways: Ways,
    center: Center,
    /// Of an encoder.
    pub(super) spent: Spent,
    fan: Vec<u32>,
    /// Neighbours of a new vertex, and what is known of them.
    pub(super) ring: Vec<u32>,
    pub(super) star: Star,
    /// Vertices that came along the boundary in this level, by the position of what they split from.
    pub(super) fresh: HashMap<u32, Vec<Fresh>>,
}

/// What outlives levels besides the model: of each vertex its level, how far off its prediction was, whether a guess hit, and the first
/// vertex at its position.
#[derive(Default)]
pub(super) struct Memory {
    pub(super) births: Vec<u8>,
    pub(super) misses: Vec<[f32; 2]>,
    pub(super) exact: Vec<bool>,
    /// First vertex at the position of each.
    pub(super) first: Vec<u32>,
    /// How many of the seams are in `first`.
    linked: usize,
}

impl Memory {
    /// Takes up what the rows say of shared positions.
    fn know(&mut self, rows: &Rows) {
        self.first.extend(self.first.len() as u32..rows.count());
        for &(v, p) in &rows.seams[self.linked..] {
            self.first[v as usize] = self.first[p as usize];
        }
        self.linked = rows.seams.len();
    }
}

impl LevelCoder {
    pub(super) fn new(new_vertices: u32, reach: usize) -> Self {
        Self {
            reach,
            start: usize::MAX,
            end: new_vertices as usize,
            at: 0,
            looked: 0,
            counts: Vec::new(),
            edges: Vec::new(),
            normals: Vec::new(),
            whole: Vec::new(),
            mean_edge: 0.0,
            counted: false,
            ways: Ways::default(),
            center: Center::default(),
            spent: Spent::default(),
            fan: Vec::new(),
            ring: Vec::new(),
            star: Star::default(),
            fresh: HashMap::new(),
        }
    }

    /// Goes on by about `limit` vertices; true once the level is whole.
    pub(super) fn step<C: Coder>(
        &mut self,
        coder: &mut C,
        (model, memory): (&mut LevelModel, &mut Memory),
        (surface, rows): (&mut Surface, &mut Rows),
        mut truth: Option<&mut LevelTruth>,
        limit: usize,
        part: &mut Level,
    ) -> Result<bool, &'static str> {
        if self.start == usize::MAX {
            self.start = rows.count() as usize;
            self.end += self.start;
            model.levels += 1;
            model.place.begin_level(coder);
            memory.births.resize(self.start, 0);
            memory.misses.resize(self.start, [0.03, 0.08]);
            memory.exact.resize(self.start, false);
            memory.know(rows);
            self.counts = vec![0; self.start];
        }
        if !self.counted {
            // Corners of each vertex.
            let until = self.looked.saturating_add(limit).min(surface.triangles.len());
            for t in &surface.triangles[self.looked..until] {
                t.iter().for_each(|&v| self.counts[v as usize] += 1);
            }
            self.looked = until;
            if until == surface.triangles.len() {
                self.counted = true;
                self.looked = 0;
            }
            return Ok(false);
        }
        if self.looked < self.start {
            let until = self.looked.saturating_add(limit).min(self.start);
            for v in self.looked..until {
                self.look(surface, rows, v as u32);
            }
            self.looked = until;
            if until == self.start {
                self.mean_edge /= (self.start as f64).max(1.0);
            }
            return Ok(false);
        }
        let stop = self.at.saturating_add(limit).min(self.start);
        while self.at < stop && coder.has(self.reach) {
            let before = coder.byte_position();
            self.vertex(coder, (model, memory), (surface, rows), truth.as_deref_mut(), part)?;
            let read = coder.byte_position() - before;
            if C::ENCODES {
                self.reach = self.reach.max(read);
            } else if read > self.reach {
                return Err("a vertex takes more bytes than the level announces");
            }
            self.at += 1;
        }
        if self.at < self.start {
            return Ok(false);
        }
        if rows.count() as usize != self.end {
            return Err("another number of vertices than the table announces");
        }
        Ok(true)
    }

    /// Mean edge length and normal of a vertex.
    fn look(&mut self, surface: &Surface, rows: &Rows, v: u32) {
        let (mut normal, mut sum, mut count) = ([0.0f32; 3], 0.0f32, 0.0f32);
        let own = position(rows, v);
        if surface.corner_of[v as usize] != NONE {
            for c in surface.around(surface.corner_of[v as usize]) {
                let a = sub(position(rows, surface.vertex(next(c))), own);
                let b = sub(position(rows, surface.vertex(previous(c))), own);
                normal = add(normal, cross(a, b));
                sum += length(a);
                count += 1.0;
            }
        }
        let l = length(normal);
        self.normals.push(scale(normal, if l > 1e-12 { 1.0 / l } else { 0.0 }));
        let mean = if count > 0.0 { sum / count } else { 0.0 };
        self.edges.push(mean);
        let corners = self.counts[v as usize];
        self.whole.push(corners > 0 && count as u32 == corners);
        self.mean_edge += f64::from(mean);
    }

    /// The splits of vertex `at`.
    fn vertex<C: Coder>(
        &mut self,
        coder: &mut C,
        (model, memory): (&mut LevelModel, &mut Memory),
        (surface, rows): (&mut Surface, &mut Rows),
        mut truth: Option<&mut LevelTruth>,
        part: &mut Level,
    ) -> Result<(), &'static str> {
        let p = self.at as u32;
        let mut last = NONE;
        let mut splits = 0;
        if !self.whole[p as usize] {
            return Ok(());
        }
        while (rows.count() as usize) < self.end && self.counts[p as usize] as usize <= VALENCE_LIMIT {
            self.gather(surface, rows, memory, p, last, splits, model.levels);
            model.ways.weigh(&self.center, &mut self.ways);
            if self.ways.ways.is_empty() {
                break;
            }
            let wanted = match truth.as_deref_mut() {
                Some(t) if C::ENCODES => self.wanted(surface, &mut t.splits[p as usize])?,
                _ => None,
            };
            let (set, at) = self.contexts(model.levels);
            let before = coder.position();
            let split = model.flag.code(coder, set, at, self.ways.opinion, wanted.is_some());
            let flagged = coder.position();
            self.spent.flags += flagged - before;
            if !split {
                model.ways.learn(&self.center, &self.ways, None);
                break;
            }
            let taken = model.ways.choose(coder, &self.ways, wanted.as_ref().map_or(0, |w| w.0));
            self.spent.ways += coder.position() - flagged;
            model.ways.learn(&self.center, &self.ways, Some(taken));
            let way = self.ways.ways[taken].way;
            let v = self.split(surface, p, way, part);
            let mesh_vertex = wanted.map(|w| w.1.vertex);
            let own = truth.as_deref().zip(mesh_vertex).map(|(t, w)| t.rows.row(w));
            let shares = match (way.side, rows.has_seams) {
                (Side::Inside, _) | (_, false) => None,
                (side, true) => self.link(coder, model, memory, (p, v, side), truth.as_deref(), mesh_vertex)?,
            };
            self.place(coder, model, memory, surface, rows, (p, v, shares), own);
            memory.know(rows);
            if let Some((t, w)) = truth.as_deref_mut().zip(mesh_vertex) {
                t.vertex_order.push(w);
            }
            part.representatives.push((v, p));
            last = v;
            splits += 1;
        }
        Ok(())
    }

    /// The neighbourhood of `p`; arcs begin after `last`.
    #[allow(clippy::too_many_arguments)]
    fn gather(&mut self, surface: &Surface, rows: &Rows, memory: &Memory, p: u32, last: u32, splits: usize, level: usize) {
        self.fan.clear();
        self.fan.extend(surface.around(surface.corner_of[p as usize]));
        let end = self.fan[self.fan.len() - 1];
        let closed = surface.turn(end) != NONE;
        if closed {
            // Begins at the last new vertex, or at the lowest neighbour.
            let key = |c: &u32| {
                let n = surface.vertex(next(*c));
                if n == last { 0 } else { u64::from(n) + 1 }
            };
            let first = (0..self.fan.len()).min_by_key(|&i| key(&self.fan[i])).unwrap_or(0);
            self.fan.rotate_left(first);
        }
        let c = &mut self.center;
        c.neighbours.clear();
        c.position = position(rows, p);
        c.closed = closed;
        let start = self.start;
        let mut edge = 2.0 * self.edges[p as usize];
        let mut push = |n: u32| {
            let state = if n as usize >= start { 2 } else { usize::from(n < p) };
            edge += self.edges[n as usize];
            c.neighbours.push(Neighbour {
                position: position(rows, n),
                valence: self.counts[n as usize] as usize,
                state,
                age: level.saturating_sub(usize::from(memory.births[n as usize])),
            });
        };
        for &c in &self.fan {
            push(surface.vertex(next(c)));
        }
        if !closed {
            push(surface.vertex(previous(self.fan[self.fan.len() - 1])));
        }
        c.edge = edge / (c.neighbours.len() as f32 + 2.0);
        c.age = level.saturating_sub(usize::from(memory.births[p as usize]));
        c.splits = splits;
        c.seam = Seam::Quiet;
        for f in self.fresh.get(&memory.first[p as usize]).into_iter().flatten() {
            c.seam = match f.side {
                _ if f.from == p => Seam::Own,
                _ if f.shared > 0 => continue,
                Side::Head => Seam::Head,
                _ => Seam::Tail,
            };
        }
        c.first = if last == NONE {
            0
        } else {
            let fan = &self.fan;
            let at = |i: usize| if i < fan.len() { surface.vertex(next(fan[i])) } else { surface.vertex(previous(fan[i - 1])) };
            (0..c.neighbours.len()).find(|&i| at(i) == last).map_or(0, |i| i + 1)
        };
    }

    /// The split that comes first, and its way.
    fn wanted(&self, surface: &Surface, splits: &mut Vec<Split>) -> Result<Option<(usize, Split)>, &'static str> {
        let n = self.center.neighbours.len();
        let fan = &self.fan;
        let at = |i: usize| if i < fan.len() { surface.vertex(next(fan[i])) } else { surface.vertex(previous(fan[i - 1])) };
        let mut best: Option<(usize, bool, usize)> = None;
        for (k, s) in splits.iter().enumerate() {
            let from = (0..n).find(|&i| at(i) == s.chain[0]).ok_or("a split elsewhere")?;
            let key = (from, s.side != Side::Head, k);
            if best.is_none_or(|b| key < b) {
                best = Some(key);
            }
        }
        let Some((from, _, k)) = best else { return Ok(None) };
        let s = splits.swap_remove(k);
        let to = from + s.chain.len() - 1;
        let way = Way { side: s.side, from, to };
        let index = self.ways.ways.iter().position(|w| w.way == way).ok_or("a split that is no way")?;
        Ok(Some((index, s)))
    }

    fn contexts(&self, level: usize) -> (usize, [usize; FLAGS]) {
        let (w, c) = (&self.ways, &self.center);
        let n = c.neighbours.len().min(17);
        let bin = ((w.opinion * 1.5 + 8.0) as i32).clamp(0, BINS as i32 - 1) as usize;
        let again = c.splits.min(2);
        let seam = c.seam as usize;
        let fresh = w.fresh.min(5);
        let done = c.neighbours.iter().filter(|x| x.state > 0).count();
        let share = (4 * done / c.neighbours.len().max(1)).min(4);
        let age = c.age.min(5);
        let at = [
            ((n.min(15) * BINS + bin) * 3 + again) * 4 + seam,
            (w.mean_length * 16 + w.most_length) * 3 + again,
            (bin * 8 + level.min(7)) * 3 + again,
            (age * 16 + w.mean_length) * 6 + fresh,
            (n * 6 + fresh) * 4 + share.min(3),
            (bin * 5 + share) * 6 + fresh,
            (n * 8 + (w.ways.len() / 8).min(7)) * 6 + fresh,
        ];
        (again * 4 + seam, at)
    }

    /// Splits `p`; gives the new vertex.
    fn split(&mut self, surface: &mut Surface, p: u32, way: Way, part: &mut Level) -> u32 {
        let k = self.fan.len();
        let at = |i: usize| if i < k || self.center.closed { next(self.fan[i % k]) } else { previous(self.fan[k - 1]) };
        let moved = way.to - way.from;
        let corners: Vec<u32> = (0..moved).map(|i| self.fan[(way.from + i) % k]).collect();
        let chain: Vec<u32> = (way.from..=way.to).map(|i| surface.vertex(at(i))).collect();
        let before = surface.triangles.len();
        let v = surface.corner_of.len() as u32;
        part.corner_moves.extend(corners.iter().map(|&c| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex: v }));
        let (first, last) = (chain[0] as usize, chain[chain.len() - 1] as usize);
        let fan = Fan { apex: p, corners, chain };
        let new = match way.side {
            Side::Inside => {
                surface.insert(&fan);
                2
            }
            side => {
                // The corner of p's fan beside the cut, if there is one.
                let beside =
                    if side == Side::Head { self.fan.get(way.to).copied() } else { way.from.checked_sub(1).map(|i| self.fan[i]) };
                surface.insert_at_boundary(&fan, side == Side::Head, beside);
                1
            }
        };
        // Neighbours at the cuts gain a triangle each.
        match way.side {
            Side::Inside => {
                self.counts[first] += 1;
                self.counts[last] += 1;
            }
            Side::Head => self.counts[last] += 1,
            Side::Tail => self.counts[first] += 1,
        }
        self.counts[p as usize] = self.counts[p as usize] + new - moved as u32;
        self.counts.push(moved as u32 + new);
        part.triangles.extend_from_slice(&surface.triangles[before..]);
        v
    }
}

fn position(rows: &Rows, v: u32) -> Vector<f32> {
    [0, 1, 2].map(|k| rows.value(v, k) as f32)
}

/// The decoder's side: what outlives levels, and the level that is being decoded.
#[derive(Default)]
pub(super) struct CompactLevels {
    model: Option<(LevelModel, Memory)>,
    level: Option<Box<LevelCoder>>,
}

impl Levels for CompactLevels {
    fn begin(&mut self, bytes: &mut Vec<u8>, new_vertices: u32, width: usize) -> bool {
        let mut reader = Reader { rest: bytes };
        let Ok(reach) = reader.varint() else { return false };
        let taken = bytes.len() - reader.rest.len();
        bytes.drain(..taken);
        self.model.get_or_insert_with(|| (LevelModel::new(width), Memory::default()));
        self.level = Some(Box::new(LevelCoder::new(new_vertices, reach as usize)));
        true
    }
    fn reach(&self) -> usize {
        self.level.as_ref().map_or(usize::MAX, |l| l.reach)
    }
    fn step(
        &mut self,
        coder: &mut RangeDecoder,
        surface: &mut Surface,
        rows: &mut Rows,
        limit: usize,
        part: &mut Level,
    ) -> Result<bool, &'static str> {
        let (Some(level), Some((model, memory))) = (&mut self.level, &mut self.model) else { return Ok(true) };
        level.step(coder, (model, memory), (surface, rows), None, limit, part)
    }
}
