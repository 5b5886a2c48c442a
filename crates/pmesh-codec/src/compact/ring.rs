//! One split by itself: of a vertex in any mesh, whatever else is split or not. Packets that refine some of a mesh are made of these.
//!
//! Which triangles go to the new vertex and where it stands is predicted as in a level, by the same models; only what a level knows of the vertices from before is not known here.

use super::center::{Center, Neighbour, Seam, Side, VALENCE_LIMIT, Way};
use super::options::{WayModel, Ways};
use super::place::{PlaceModel, Star};
use super::vector::sub;
use crate::range::{Chance, Coder};

/// A vertex about one that splits.
#[derive(Clone, Copy, Debug, Default)]
pub struct RingVertex {
    /// Where it is, on the grid.
    pub row: [i32; 3],
    /// About how long edges are there, in steps of the grid; 0: not known.
    pub edge: f32,
    /// Its normal, or nothing.
    pub normal: [f64; 3],
    /// How much finer than the one that splits, 0 to 9; 4 is alike.
    pub age: u8,
}

/// A vertex that splits, and those about it.
#[derive(Clone, Debug, Default)]
pub struct Ring {
    /// The vertex.
    pub own: RingVertex,
    /// About how far the new vertex is from the surface, and how far along it from where one would guess, in parts of the ring's radius.
    pub off: [f64; 2],
    /// Those about it, counter-clockwise.
    pub about: Vec<RingVertex>,
    /// They are a circle.
    pub closed: bool,
}

/// What a split does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RingSplit {
    /// From which vertex of the ring on, and up to which, the new one gets what lies between; one may be missing, where the ring is no circle: the end.
    pub cuts: [Option<u32>; 2],
    /// Where the new vertex is, on the grid.
    pub place: [i32; 3],
}

/// What is learnt from split to split.
#[derive(Clone, Debug)]
pub struct RingModel {
    /// Bits that said which triangles, and where.
    pub spent: [f64; 2],
    ways: WayModel,
    place: PlaceModel,
    /// The ring is none that has the way: one with too many vertices, or with one twice.
    odd: Chance,
    scratch: Box<Scratch>,
}

#[derive(Clone, Debug, Default)]
struct Scratch {
    center: Center,
    ways: Ways,
    star: Star,
}

impl Default for RingModel {
    fn default() -> Self {
        Self { spent: [0.0; 2], ways: WayModel::new(), place: PlaceModel::new(), odd: Chance::default(), scratch: Box::default() }
    }
}

impl RingModel {
    /// Codes a split. Errors: one that cannot be. O(vertices²) of up to 32, else O(vertices).
    pub fn code<C: Coder>(&mut self, coder: &mut C, ring: &Ring, truth: Option<RingSplit>) -> Result<RingSplit, &'static str> {
        let before = coder.position();
        let n = ring.about.len();
        if truth.is_some_and(|t| t.cuts.iter().flatten().any(|&c| c as usize >= n)) {
            return Err("a cut that is not about the vertex");
        }
        let fits = n >= if ring.closed { 3 } else { 2 } && n <= VALENCE_LIMIT;
        let cuts = if fits {
            let way = truth.map(|t| way_of(t.cuts, n, ring.closed));
            let can = self.weigh(ring);
            let listed = way.is_none_or(|w| w.is_some()) && can;
            if coder.bit(&mut self.odd, !listed) || !can {
                raw_cuts(coder, n, truth.map(|t| t.cuts))?
            } else {
                let Scratch { center, ways, .. } = &mut *self.scratch;
                let way = self.ways.choose(coder, center, ways, way.flatten()).ok_or("a split where none can be")?;
                self.ways.learn(center, ways, Some(way));
                cuts_of(way, n)
            }
        } else {
            raw_cuts(coder, n, truth.map(|t| t.cuts))?
        };
        if cuts[0] == cuts[1] || (ring.closed && cuts.contains(&None)) {
            return Err("a split that is none");
        }
        let chosen = coder.position();
        self.spent[0] += chosen - before;
        self.aim(ring, cuts);
        let size = f64::from(ring.own.edge);
        let (place, ..) = self.place.code(coder, &self.scratch.star, size, truth.map(|t| t.place));
        self.spent[1] += coder.position() - chosen;
        Ok(RingSplit { cuts, place })
    }

    /// About how many bytes it takes: tables that do not grow.
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + size_of::<Scratch>() + self.ways.memory_bytes() + self.place.memory_bytes()
    }
    /// Weighs the ways of a ring; false if there are none.
    fn weigh(&mut self, ring: &Ring) -> bool {
        let Scratch { center: c, ways, .. } = &mut *self.scratch;
        let float = |row: [i32; 3]| row.map(|x| x as f32);
        c.position = float(ring.own.row);
        c.edge = ring.own.edge;
        (c.count, c.first, c.age, c.splits) = (0, 0, 0, 0);
        (c.closed, c.seam) = (ring.closed, Seam::Quiet);
        for (i, v) in ring.about.iter().enumerate() {
            let position = float(v.row);
            let arm = sub(position, c.position);
            let edge = if v.edge > 0.0 { v.edge } else { arm.iter().map(|x| x * x).sum::<f32>().sqrt() };
            c.push(Neighbour { vertex: i as u32, position, edge, valence: 6, state: 1, age: v.age });
        }
        self.ways.weigh(c, ways);
        ways.any
    }
    /// The ring of the new vertex.
    fn aim(&mut self, ring: &Ring, cuts: [Option<u32>; 2]) {
        let star = &mut self.scratch.star;
        let n = ring.about.len() as u32;
        let (from, to) = (cuts[0].unwrap_or(0), cuts[1].unwrap_or(n - 1));
        let count = if to >= from { to - from } else { to + n - from };
        star.closed = cuts[0].is_some() && cuts[1].is_some();
        let arc = (from..=from + count).map(|i| ring.about[(i % n) as usize]);
        // Along the boundary the old vertex is the ring's end.
        let is_last = cuts[0].is_none();
        let own = std::iter::once(ring.own);
        star.ring.clear();
        star.normals.clear();
        star.valences.clear();
        star.beyond.clear();
        let mut take = |v: RingVertex| {
            star.ring.push(v.row.map(f64::from));
            star.normals.push(v.normal);
            star.valences.push(6.0);
            star.beyond.push(None);
        };
        if is_last {
            arc.chain(own).for_each(&mut take);
        } else {
            own.chain(arc).for_each(&mut take);
        }
        star.onto = if is_last { star.ring.len() - 1 } else { 0 };
        star.misses = ring.off;
        star.exact = 0;
    }
}

/// A way by its cuts.
fn way_of(cuts: [Option<u32>; 2], n: usize, closed: bool) -> Option<Way> {
    let n = n as u32;
    let [from, to] = cuts.map(|c| c.filter(|&c| c < n));
    let way = |side, from: u32, to: u32| Some(Way { side, from: from as u8, to: to as u8 });
    match (from, to) {
        (Some(from), Some(to)) if from < to => way(Side::Inside, from, to),
        (Some(from), Some(to)) if closed && from > to => way(Side::Inside, from, to + n),
        (None, Some(to)) if !closed => way(Side::Head, 0, to),
        (Some(from), None) if !closed => way(Side::Tail, from, n - 1),
        _ => None,
    }
}
fn cuts_of(way: Way, n: usize) -> [Option<u32>; 2] {
    let (from, to) = way.range();
    let (from, to) = (from as u32, (to % n) as u32);
    match way.side {
        Side::Inside => [Some(from), Some(to)],
        Side::Head => [None, Some(to)],
        Side::Tail => [Some(from), None],
    }
}
/// Cuts without a guess.
fn raw_cuts<C: Coder>(coder: &mut C, n: usize, truth: Option<[Option<u32>; 2]>) -> Result<[Option<u32>; 2], &'static str> {
    let bits = 32 - (n as u32).leading_zeros();
    let mut cuts = [None; 2];
    for (k, cut) in cuts.iter_mut().enumerate() {
        let value = coder.raw(bits, truth.map_or(0, |t| t[k].map_or(0, |c| c + 1)));
        if value > n as u32 {
            return Err("a cut that is not about the node");
        }
        *cut = value.checked_sub(1);
    }
    Ok(cuts)
}
