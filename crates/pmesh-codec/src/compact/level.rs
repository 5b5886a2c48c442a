//! One level: vertex by vertex, whether it splits, how, and where the new vertex stands.

use super::arrival::Fresh;
use super::center::{Center, Neighbour, SIDES, Seam, Side, VALENCE_LIMIT, Way};
use super::mixer::Mixer;
use super::options::{WayModel, Ways};
use super::place::{PlaceModel, Star};
use super::site::{Memory, Site, position};
use super::truth::{LevelTruth, Split, Splits};
use crate::pmesh::varint::Reader;
use crate::range::{Chance, Coder, NumberModel, RangeDecoder, SignedModel};
use crate::refine::Levels;
use crate::refine::rows::Rows;
use pmesh_core::surface::{Fan, NONE, Surface};
use pmesh_core::{CornerMove, Level};
use std::collections::HashMap;

/// Values of the contexts of "does it split?".
const BINS: usize = 16;
const FLAGS: usize = 3;

/// What goes on being learnt from level to level.
pub(super) struct LevelModel {
    flag: Mixer<FLAGS>,
    again: Mixer<5>,
    ways: WayModel,
    pub(super) place: PlaceModel,
    pub(super) attributes: Vec<SignedModel>,
    /// Which new vertex shares the position, by how many there are to share with.
    pub(super) link: [NumberModel; 4],
    pub(super) levels: usize,
    /// The next bit of a coordinate, by axis.
    pub(super) sharper: [Chance; 3],
}

impl LevelModel {
    pub(super) fn new(width: usize) -> Self {
        let sizes = [BINS * BINS * 4, BINS * 8 * 6, 6 * 16 * 5];
        Self {
            flag: Mixer::new(sizes, 4, 0.5 / 3.0, 0.7),
            again: Mixer::new([18 * 18 * 4, 16 * 18 * 4, 6 * 16 * 6, 18 * 18 * 4, 16 * 8 * 18], 1, 0.2, 0.4),
            ways: WayModel::new(),
            place: PlaceModel::new(),
            attributes: (3..width).map(|_| SignedModel::default()).collect(),
            link: Default::default(),
            levels: 0,
            sharper: Default::default(),
        }
    }
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
    /// Lower bits of where earlier ones stand.
    pub sharper: f64,
    /// Their attributes.
    pub attributes: f64,
}

impl Spent {
    pub(super) fn plus(self, other: Spent) -> Spent {
        Spent {
            flags: self.flags + other.flags,
            ways: self.ways + other.ways,
            places: self.places + other.places,
            sharper: self.sharper + other.sharper,
            attributes: self.attributes + other.attributes,
        }
    }
}

/// The coder of either direction, in steps.
pub(super) struct LevelCoder {
    /// Most bytes that a vertex takes: announced to a decoder, found by an encoder.
    pub(super) reach: usize,
    coming: usize,
    /// Vertices before the level, and after.
    pub(super) start: usize,
    end: usize,
    /// The vertex that is asked next, and how many were.
    at: u32,
    asked: usize,
    /// The vertex whose next bit comes next, those that have moved, and whether all bits are there that the level brings.
    pub(super) sharper: usize,
    pub(super) moved: u32,
    pub(super) is_sharp: bool,
    /// Triangles and vertices of the base that have been looked at.
    counted: usize,
    looked: usize,
    /// Mean edge length of the vertices of the level before, and the sum of those asked in this one.
    pub(super) mean_edge: f64,
    edges: f64,
    ways: Ways,
    center: Center,
    pub(super) spent: Spent,
    fan: [u32; SIDES],
    about: [u32; SIDES],
    /// Where in a closed fan the neighbours begin.
    begin: usize,
    /// Triangles of the new vertex.
    pub(super) valence: u16,
    /// Neighbours of a new vertex, and what is known of them.
    pub(super) ring: Vec<u32>,
    pub(super) star: Star,
    /// Vertices that came along the boundary in this level, by the position of what they split from.
    pub(super) fresh: HashMap<u32, Vec<Fresh>>,
}

/// Vertices that a small mesh has room for.
const ROOM: usize = 1024;

impl LevelCoder {
    /// `coming` vertices more are announced, those of the level included.
    pub(super) fn new(new_vertices: u32, coming: u64, reach: usize) -> Self {
        Self {
            coming: usize::try_from(coming).unwrap_or(usize::MAX).clamp(new_vertices as usize, u32::MAX as usize),
            reach,
            start: usize::MAX,
            end: new_vertices as usize,
            at: 0,
            asked: 0,
            sharper: usize::MAX,
            moved: 0,
            is_sharp: false,
            counted: 0,
            looked: 0,
            mean_edge: 0.0,
            edges: 0.0,
            ways: Ways::default(),
            center: Center::default(),
            spent: Spent::default(),
            fan: [NONE; SIDES],
            about: [NONE; SIDES],
            begin: 0,
            valence: 0,
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
            memory.know(rows);
            self.looked = memory.count();
            // Room for all that is announced, or half of it, or a quarter: so nothing is left unused at the end, and what is copied then is half as
            // large. What is to come is not believed beyond twice what is there. The largest first: each is there twice for a moment.
            let mut room = self.start.saturating_add(self.coming);
            while room / 2 >= self.end.max(1) {
                room = room.div_ceil(2);
            }
            let more = (room - self.start).min(2 * self.start.max(ROOM));
            memory.reserve(more);
            surface.reserve(more, 2 * more);
            rows.values.reserve_exact(more * rows.width);
            if self.looked == 0 {
                let site = |next| Site { next, misses: [0.03, 0.08], ..Default::default() };
                memory.sites.extend((1..=self.start as u32).map(site));
            }
        }
        // The base: later vertices are known as they come.
        if self.looked < self.start && self.counted < surface.triangles.len() {
            let until = self.counted.saturating_add(limit).min(surface.triangles.len());
            surface.triangles[self.counted..until].iter().flatten().for_each(|&v| memory.touch(v));
            self.counted = until;
            return Ok(false);
        }
        if self.looked < self.start {
            let until = self.looked.saturating_add(limit).min(self.start);
            (self.looked..until).for_each(|v| memory.look(surface, rows, v as u32));
            self.looked = until;
            if until == self.start {
                memory.mean_edge /= (self.start as f64).max(1.0);
            }
            return Ok(false);
        }
        if !self.is_sharp {
            self.sharpen(coder, (model, memory), rows, truth.as_deref(), limit)?;
            // New vertices come in a part of their own: all numbers are the same however the bytes are cut.
            return Ok(false);
        }
        self.mean_edge = memory.mean_edge;
        let stop = self.asked.saturating_add(limit).min(self.start);
        while self.asked < stop && coder.has(self.reach) {
            let before = coder.byte_position();
            let next = memory.sites[self.at as usize].next;
            self.vertex(coder, (model, memory), (surface, rows), truth.as_deref_mut(), part)?;
            self.read(coder, before)?;
            memory.sites[self.at as usize].mark_asked(model.levels);
            self.at = next;
            self.asked += 1;
        }
        if self.asked < self.start {
            return Ok(false);
        }
        if memory.count() != self.end {
            return Err("another number of vertices than the table announces");
        }
        memory.mean_edge = self.edges / (self.start as f64).max(1.0);
        Ok(true)
    }

    /// Holds what a vertex took, from `before` on, against what the level announces, or announces it.
    pub(super) fn read<C: Coder>(&mut self, coder: &C, before: usize) -> Result<(), &'static str> {
        let read = coder.byte_position() - before;
        if C::ENCODES {
            self.reach = self.reach.max(read);
        } else if read > self.reach {
            return Err("a vertex takes more bytes than the level announces");
        }
        Ok(())
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
        let p = self.at;
        let mut last = NONE;
        let mut splits = 0;
        let mut moved = 0;
        while memory.count() < self.end {
            let wanted = truth.as_deref().is_some_and(|t| t.splits.any(p));
            let before = coder.position();
            if splits > 0 {
                // Mostly not; so the neighbours are not asked.
                let site = &memory.sites[p as usize];
                let valence = usize::from(site.valence).min(17);
                let w = &self.ways;
                let bin = ((w.rest * 1.5 + 8.0) as i32).clamp(0, BINS as i32 - 1) as usize;
                let ages = self.center.age.min(5);
                let at = [
                    (valence * 18 + moved) * 4 + splits.min(3),
                    (bin * 4 + splits.min(3)) * 18 + self.center.count.min(17),
                    (ages * 16 + w.mean_length) * 6 + w.fresh.min(5),
                    (w.free.min(17) * 18 + moved) * 4 + splits.min(3),
                    (bin * 8 + model.levels.min(7)) * 18 + moved,
                ];
                let again = model.again.code(coder, 0, at, w.rest, wanted);
                self.spent.flags += coder.position() - before;
                if !again {
                    break;
                }
            }
            if !self.gather(surface, (memory, rows), p, last, splits, model.levels) {
                break;
            }
            model.ways.weigh(&self.center, &mut self.ways);
            let site = &mut memory.sites[p as usize];
            (site.edge, site.normal) = (self.ways.edge, self.ways.normal);
            if splits == 0 {
                self.edges += f64::from(site.edge);
            }
            if !self.ways.any {
                break;
            }
            let wanted = match truth.as_deref_mut() {
                Some(t) if C::ENCODES => self.wanted(t.splits, p)?,
                _ => None,
            };
            let before = coder.position();
            if splits == 0 {
                let (set, at) = self.contexts(model.levels);
                let split = model.flag.code(coder, set, at, self.ways.opinion, wanted.is_some());
                self.spent.flags += coder.position() - before;
                if !split {
                    model.ways.learn(&self.center, &self.ways, None);
                    break;
                }
            }
            let flagged = coder.position();
            let way = model.ways.choose(coder, &self.center, &mut self.ways, wanted.as_ref().map(|w| w.0));
            self.spent.ways += coder.position() - flagged;
            let way = way.ok_or("a split where none can be")?;
            model.ways.learn(&self.center, &self.ways, Some(way));
            let v = self.split(surface, memory, p, way, part)?;
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
            let (from, to) = way.range();
            moved = (to - from).min(17);
        }
        Ok(())
    }

    /// The neighbourhood of `p`; arcs begin after `last`. False if its triangles are not one fan, or too many: such a vertex never
    /// splits.
    fn gather(
        &mut self,
        surface: &Surface,
        (memory, rows): (&Memory, &Rows),
        p: u32,
        last: u32,
        splits: usize,
        level: usize,
    ) -> bool {
        let site = &memory.sites[p as usize];
        let valence = usize::from(site.valence);
        if valence == 0 || valence > VALENCE_LIMIT {
            return false;
        }
        let Some((corners, closed)) = surface.fan_of(p, &mut self.fan, &mut self.about) else { return false };
        if corners != valence {
            return false;
        }
        let ring = &self.about[..if closed { corners } else { corners + 1 }];
        // A closed fan begins at the last new vertex, or at the lowest neighbour.
        let (mut begin, mut lowest) = (0, u32::MAX);
        if closed {
            for (i, &n) in ring.iter().enumerate() {
                if n == last {
                    begin = i;
                    break;
                }
                if n < lowest {
                    (begin, lowest) = (i, n);
                }
            }
        }
        self.begin = begin;
        let (end, start) = ring.split_at(begin);
        let c = &mut self.center;
        c.position = position(rows, p);
        c.edge = site.edge;
        c.closed = closed;
        c.count = 0;
        c.first = 0;
        for (i, &n) in start.iter().chain(end).enumerate() {
            let site = &memory.sites[n as usize];
            if n == last {
                c.first = i + 1;
            }
            c.push(Neighbour {
                vertex: n,
                position: position(rows, n),
                edge: site.edge,
                valence: site.valence,
                state: if n as usize >= self.start { 2 } else { u8::from(site.was_asked(level)) },
                age: level.saturating_sub(site.birth.into()).min(255) as u8,
            });
        }
        c.age = level.saturating_sub(usize::from(site.birth));
        c.splits = splits;
        c.seam = Seam::Quiet;
        if !self.fresh.is_empty() {
            for f in self.fresh.get(&memory.first(p)).into_iter().flatten() {
                c.seam = match f.side {
                    _ if f.from == p => Seam::Own,
                    _ if f.shared > 0 => continue,
                    Side::Head => Seam::Head,
                    _ => Seam::Tail,
                };
            }
        }
        true
    }

    /// The split of `p` that comes first, and its way.
    fn wanted(&self, splits: &mut Splits, p: u32) -> Result<Option<(Way, Split)>, &'static str> {
        let around = self.center.neighbours();
        let key = |s: &Split| around.iter().position(|n| n.vertex == s.from).map(|from| (from, s.side != Side::Head));
        let first = splits.take(p, key)?;
        Ok(first.map(|((from, _), s)| {
            let to = from + s.count as usize - 1;
            (Way { side: s.side, from: from as u8, to: to as u8 }, s)
        }))
    }

    fn contexts(&self, level: usize) -> (usize, [usize; FLAGS]) {
        let (w, c) = (&self.ways, &self.center);
        let n = c.count.min(17);
        let bin = ((w.opinion * 1.5 + 8.0) as i32).clamp(0, BINS as i32 - 1) as usize;
        let seam = c.seam as usize;
        let fresh = w.fresh.min(5);
        let done = c.neighbours().iter().filter(|x| x.state > 0).count();
        let share = (4 * done / c.count.max(1)).min(4);
        let age = c.age.min(5);
        let at =
            [(n.min(15) * BINS + bin) * 4 + seam, (bin * 8 + level.min(7)) * 6 + fresh, (age * 16 + w.mean_length) * 5 + share];
        (seam, at)
    }

    /// Splits `p`; gives the new vertex. Errors: a triangle that has `p` twice would have the new vertex twice, its own neighbour.
    fn split(
        &mut self,
        surface: &mut Surface,
        memory: &mut Memory,
        p: u32,
        way: Way,
        part: &mut Level,
    ) -> Result<u32, &'static str> {
        let (from, to) = way.range();
        let around = self.center.neighbours();
        let k = if self.center.closed { around.len() } else { around.len() - 1 };
        let moved = to - from;
        let corner = |i: usize| self.fan[(i + self.begin) % k];
        let corners: Vec<u32> = (from..to).map(corner).collect();
        if corners.iter().enumerate().any(|(i, c)| corners[..i].iter().any(|d| d / 3 == c / 3)) {
            return Err("a split that takes two corners of a triangle");
        }
        let chain: Vec<u32> = (from..=to).map(|i| around[i % around.len()].vertex).collect();
        let before = surface.triangles.len();
        let v = surface.corner_of.len() as u32;
        part.corner_moves.extend(corners.iter().map(|&c| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex: v }));
        let (first, last) = (chain[0], chain[moved]);
        let fan = Fan { apex: p, corners, chain };
        let new = match way.side {
            Side::Inside => {
                surface.insert(&fan);
                2
            }
            side => {
                // The corner of p's fan beside the cut, if there is one.
                let beside = if side == Side::Head { (to < k).then(|| self.fan[to]) } else { from.checked_sub(1).map(corner) };
                surface.insert_at_boundary(&fan, side == Side::Head, beside);
                1
            }
        };
        // Neighbours at the cuts gain a triangle each.
        if way.side != Side::Tail {
            memory.touch(last);
        }
        if way.side != Side::Head {
            memory.touch(first);
        }
        let site = &mut memory.sites[p as usize];
        site.valence = site.valence + new - moved as u16;
        self.valence = moved as u16 + new;
        part.triangles.extend_from_slice(&surface.triangles[before..]);
        Ok(v)
    }
}

/// The decoder's side: what outlives levels, and the level that is being decoded.
#[derive(Default)]
pub(super) struct CompactLevels {
    model: Option<(LevelModel, Memory)>,
    level: Option<Box<LevelCoder>>,
    coming: u64,
    /// Of the levels before.
    before: Spent,
}

impl Levels for CompactLevels {
    fn expect(&mut self, vertices: u64) {
        self.coming = vertices;
    }
    fn begin(&mut self, bytes: &mut Vec<u8>, new_vertices: u32, width: usize) -> bool {
        let mut reader = Reader { rest: bytes };
        let Ok(reach) = reader.varint() else { return false };
        let taken = bytes.len() - reader.rest.len();
        bytes.drain(..taken);
        self.model.get_or_insert_with(|| (LevelModel::new(width), Memory::default()));
        self.before = self.before.plus(self.level.take().map_or_else(Spent::default, |l| l.spent));
        self.level = Some(Box::new(LevelCoder::new(new_vertices, self.coming, reach as usize)));
        true
    }
    fn components(&self) -> Vec<(&'static str, f64)> {
        let now = self.level.as_ref().map_or_else(Spent::default, |l| l.spent);
        let Spent { flags, ways, places, sharper, attributes } = self.before.plus(now);
        vec![("flags", flags), ("connectivity", ways), ("geometry", places + sharper), ("attributes", attributes)]
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
