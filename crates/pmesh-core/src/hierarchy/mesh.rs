//! The mesh of a front, split and collapsed in any order that keeps it a manifold.

use super::NONE;
use crate::surface::{Surface, next, previous};

/// Triangles of a front. A vertex keeps its number as long as it is there, and gets it back; so does a triangle.
#[derive(Clone, Debug, Default)]
pub struct FrontMesh {
    surface: Surface,
    /// Triangles that are there, in no order; and where in that list each is, or [`NONE`].
    shown: Vec<u32>,
    shown_at: Vec<u32>,
    /// Places of `shown` whose triangle or corners are others than a renderer has seen; only if there is one.
    changes: Option<Vec<u32>>,
    own: Ring,
    other: Ring,
    fan: Vec<u32>,
}

/// Changes that are noted one by one, beside twice the triangles.
const CHANGES_LIMIT: usize = 4096;
/// Largest product of two rings that are compared: what is larger stays split.
const RINGS_LIMIT: usize = 1 << 18;

/// A fan: corners at its apex and the vertices about it, counter-clockwise.
#[derive(Clone, Debug, Default)]
struct Ring {
    corners: Vec<u32>,
    vertices: Vec<u32>,
    closed: bool,
}

impl Ring {
    fn gather(&mut self, s: &Surface, start: u32) {
        self.corners.clear();
        self.vertices.clear();
        self.closed = false;
        if start == NONE {
            return;
        }
        // Most fans are closed: forward first.
        let mut c = start;
        loop {
            self.corners.push(c);
            c = s.turn(c);
            if c == start {
                self.closed = true;
                break;
            }
            if c == NONE {
                self.corners.clear();
                self.corners.extend(s.around(start));
                break;
            }
        }
        self.vertices.extend(self.corners.iter().map(|&c| s.vertex(next(c))));
        if !self.closed {
            self.vertices.push(s.vertex(previous(self.corners[self.corners.len() - 1])));
        }
    }
}

/// What a collapse takes away: triangles, and the corner of each that stays where it is.
#[derive(Clone, Copy, Debug)]
struct Gone {
    triangles: [u32; 2],
    corners: [u32; 2],
    count: usize,
}

impl Gone {
    fn triangles(&self) -> &[u32] {
        &self.triangles[..self.count]
    }
    fn corners(&self) -> &[u32] {
        &self.corners[..self.count]
    }
}

/// True if the fan at a corner has fewer triangles than a vertex must have that loses one.
fn is_thin(s: &Surface, start: u32) -> bool {
    let (mut c, mut count) = (start, 0);
    loop {
        count += 1;
        c = s.turn(c);
        if c == start {
            return count < 4;
        }
        if count >= 4 {
            return false;
        }
        if c == NONE {
            return s.around(start).take(2).count() < 2;
        }
    }
}

/// What a split brings and a collapse takes away: the triangles (blue, red, x) and (blue, y, red), each with its number.
pub(super) type Pair = [u32; 2];

impl FrontMesh {
    /// The base mesh: vertices 0 to `vertices`, which all corners are. O(triangles).
    pub(super) fn new(vertices: u32, triangles: Vec<[u32; 3]>) -> Self {
        let surface = Surface::new(triangles, vertices);
        let shown: Vec<u32> = (0..surface.triangles.len() as u32).collect();
        Self { surface, shown_at: shown.clone(), shown, ..Default::default() }
    }
    /// Numbers of the triangles that are there, in no order.
    pub fn shown(&self) -> &[u32] {
        &self.shown
    }
    /// A triangle that is there.
    pub fn triangle(&self, t: u32) -> Option<[u32; 3]> {
        self.surface.triangles.get(t as usize).copied().filter(|t| t[0] != NONE)
    }

    /// From now on changes are noted, for [`Self::take_changes`]: all that is there, for a beginning.
    pub(super) fn watch(&mut self) {
        self.changes = Some((0..self.shown.len() as u32).collect());
    }
    /// Places in the list of triangles where another triangle is than when last asked, or one with other corners; some twice, some past the end by now.
    pub(super) fn take_changes(&mut self) -> Vec<u32> {
        self.changes.as_mut().map(std::mem::take).unwrap_or_default()
    }
    fn note(&mut self, corners: impl Iterator<Item = u32>) {
        if let Some(changes) = &mut self.changes {
            changes.extend(corners.map(|c| self.shown_at[c as usize / 3]).filter(|&at| at != NONE));
            // Nobody has asked for long: everything is simpler then.
            if changes.len() > 2 * self.shown.len() + CHANGES_LIMIT {
                *changes = (0..self.shown.len() as u32).collect();
            }
        }
    }
    /// Triangles about a vertex, as its corners; none if it is not there.
    pub(super) fn around(&self, v: u32) -> impl Iterator<Item = [u32; 3]> {
        let start = self.surface.corner_of.get(v as usize).copied().filter(|&c| c != NONE);
        start.into_iter().flat_map(|c| self.surface.around(c)).map(|c| self.surface.triangles[c as usize / 3])
    }
    /// Corners at a vertex and the vertices about it, counter-clockwise, and whether they close. O(valence).
    pub(super) fn fan(&mut self, v: u32) -> (&[u32], &[u32], bool) {
        let start = self.surface.corner_of.get(v as usize).copied().unwrap_or(NONE);
        self.own.gather(&self.surface, start);
        (&self.own.corners, &self.own.vertices, self.own.closed)
    }
    /// Fans begin there from now on.
    pub(super) fn begin_at(&mut self, v: u32, corner: u32) {
        self.surface.corner_of[v as usize] = corner;
    }
    /// The same mesh, that nobody draws.
    pub(super) fn undrawn(&self) -> Self {
        Self { changes: None, ..self.clone() }
    }
    /// Renames vertices and triangles; `None` drops them, which no shown triangle may need. O(all).
    pub(super) fn rename(
        &mut self,
        vertex: impl Fn(u32) -> Option<u32>,
        triangle: impl Fn(u32) -> Option<u32>,
        (vertices, triangles): (u32, u32),
    ) {
        let old = std::mem::take(&mut self.surface);
        let mut s = Surface {
            triangles: vec![[NONE; 3]; triangles as usize],
            across: vec![NONE; 3 * triangles as usize],
            corner_of: vec![NONE; vertices as usize],
        };
        let corner = |c: u32| if c == NONE { NONE } else { triangle(c / 3).map_or(NONE, |t| 3 * t + c % 3) };
        self.shown_at = vec![NONE; triangles as usize];
        for (at, t) in self.shown.iter_mut().enumerate() {
            let (was, now) = (*t as usize, triangle(*t).unwrap_or(0));
            s.triangles[now as usize] = old.triangles[was].map(|v| vertex(v).unwrap_or(NONE));
            (0..3).for_each(|k| s.across[3 * now as usize + k] = corner(old.across[3 * was + k]));
            self.shown_at[now as usize] = at as u32;
            *t = now;
        }
        for (v, &c) in old.corner_of.iter().enumerate() {
            if let Some(v) = vertex(v as u32) {
                s.corner_of[v as usize] = corner(c);
            }
        }
        self.surface = s;
        if let Some(changes) = &mut self.changes {
            *changes = (0..self.shown.len() as u32).collect();
        }
    }
    /// Bytes, without room for more.
    pub(super) fn memory_bytes(&self) -> usize {
        28 * self.surface.triangles.len() + 4 * (self.surface.corner_of.len() + self.shown.len())
    }

    /// Splits `red`: `blue` takes its triangles from neighbour `cuts[0]` on, counter-clockwise, up to `cuts[1]`; one of them missing ([`NONE`]) is the end of the
    /// boundary. False, and nothing is changed, if the cuts are not about `red`. O(valence).
    pub(super) fn split(&mut self, red: u32, blue: u32, cuts: [u32; 2], triangles: Pair) -> bool {
        let start = self.surface.corner_of.get(red as usize).copied().unwrap_or(NONE);
        self.own.gather(&self.surface, start);
        let ring = &self.own;
        let find = |v: u32| ring.vertices.iter().position(|&w| w == v);
        let count = ring.corners.len();
        // The first of the fan's triangles, and how many.
        let fan = match cuts {
            [NONE, NONE] => None,
            [NONE, to] if !ring.closed => find(to).map(|to| (0, to)),
            [from, NONE] if !ring.closed => find(from).map(|from| (from, count - from)),
            [from, to] => find(from).zip(find(to)).and_then(|(from, to)| match (to > from, ring.closed) {
                (true, _) => Some((from, to - from)),
                (false, true) if from != to => Some((from, to + count - from)),
                _ => None,
            }),
        };
        let Some((from, moved)) = fan else { return false };
        let mut fan = std::mem::take(&mut self.fan);
        fan.clear();
        fan.extend((from..from + moved).map(|i| ring.corners[i % count]));
        // The triangles of red beside the fan: before it, and after it.
        let beside = |i: usize| if ring.closed { ring.corners.get(i % count) } else { ring.corners.get(i) };
        let before = if ring.closed { beside(from + count - 1) } else { from.checked_sub(1).and_then(beside) };
        let (before, after) = (before.map(|&c| previous(c)), beside(from + moved).copied());
        let (first, last) = (fan.first().copied(), fan.last().map(|&c| previous(c)));
        let s = &mut self.surface;
        fan.iter().for_each(|&c| s.triangles[c as usize / 3][c as usize % 3] = blue);
        let room = |list: &mut Vec<u32>, index: u32| list.resize(list.len().max(index as usize + 1), NONE);
        room(&mut s.corner_of, blue);
        let mut edge = None;
        for (k, (&t, cut)) in triangles.iter().zip(cuts).enumerate().filter(|(_, (_, cut))| *cut != NONE) {
            s.triangles.resize(s.triangles.len().max(t as usize + 1), [NONE; 3]);
            room(&mut s.across, 3 * t + 2);
            let c = 3 * t;
            // Edges in the triangle: between blue and red, of red, of blue; and what lay there.
            let (corners, between, reds, blues, red_side, blue_side) = if k == 0 {
                ([blue, red, cut], c, c + 1, c + 2, before, first)
            } else {
                ([blue, cut, red], c + 2, c + 1, c, after, last)
            };
            s.triangles[t as usize] = corners;
            pair(s, reds, red_side.unwrap_or(NONE));
            pair(s, blues, blue_side.unwrap_or(NONE));
            s.across[between as usize] = NONE;
            if let Some(other) = edge.replace(between) {
                pair(s, between, other);
            }
            (s.corner_of[blue as usize], s.corner_of[red as usize]) = if k == 0 { (c, c + 1) } else { (c, c + 2) };
            room(&mut self.shown_at, t);
            self.shown_at[t as usize] = self.shown.len() as u32;
            self.shown.push(t);
        }
        let new = triangles.into_iter().zip(cuts).filter(|(_, cut)| *cut != NONE).map(|(t, _)| 3 * t);
        self.note(fan.iter().copied().chain(new));
        self.fan = fan;
        true
    }

    /// Undoes [`Self::split`], wherever the cuts are now; false, and nothing is changed, if what is left would be no manifold: the two have a neighbour
    /// in common beside the cuts, or a vertex would be left with too few triangles. O(valence).
    pub(super) fn collapse(&mut self, red: u32, blue: u32, triangles: Pair) -> bool {
        let Some(gone) = self.look_at_collapse(red, blue, triangles) else { return false };
        let moved = std::mem::take(&mut self.own.corners);
        self.note(moved.iter().copied());
        let s = &mut self.surface;
        moved.iter().for_each(|&c| s.triangles[c as usize / 3][c as usize % 3] = red);
        for (&t, &c) in gone.triangles().iter().zip(gone.corners()) {
            // The edges at the third corner: what lay across them meets.
            let (a, b) = (s.across[c as usize], s.across[previous(c) as usize]);
            for (e, f) in [(a, b), (b, a)] {
                if e != NONE {
                    s.across[e as usize] = f;
                }
            }
            s.across[3 * t as usize..3 * t as usize + 3].fill(NONE);
            s.triangles[t as usize] = [NONE; 3];
            let at = std::mem::replace(&mut self.shown_at[t as usize], NONE);
            self.shown.swap_remove(at as usize);
            if let Some(&moved) = self.shown.get(at as usize) {
                self.shown_at[moved as usize] = at;
            }
            if let Some(changes) = &mut self.changes {
                changes.push(at);
            }
        }
        s.corner_of[blue as usize] = NONE;
        // Corners of those that are left, from what is left of the two fans and of the cuts'.
        let there = |s: &Surface, c: u32| s.triangles[c as usize / 3][0] != NONE;
        let left = moved.iter().chain(&self.other.corners).copied();
        s.corner_of[red as usize] = left.clone().find(|&c| there(s, c)).unwrap_or(NONE);
        for c in left.filter(|&c| s.triangles[c as usize / 3][0] != NONE) {
            let triangle = s.triangles[c as usize / 3];
            [next(c), previous(c)].into_iter().for_each(|c| s.corner_of[triangle[c as usize % 3] as usize] = c);
        }
        self.own.corners = moved;
        true
    }
    /// True if [`Self::collapse`] could be done now. O(valence).
    pub(super) fn can_collapse(&mut self, red: u32, blue: u32, triangles: Pair) -> bool {
        self.look_at_collapse(red, blue, triangles).is_some()
    }
    /// What goes, if it can; the fan of blue is in `own` then, that of red in `other`.
    fn look_at_collapse(&mut self, red: u32, blue: u32, triangles: Pair) -> Option<Gone> {
        let s = &self.surface;
        let there = |t: u32| s.triangles.get(t as usize).is_some_and(|x| x.contains(&blue) && x.contains(&red));
        let third = |t: u32| (3 * t..3 * t + 3).find(|&c| s.vertex(c) != blue && s.vertex(c) != red);
        let mut gone = Gone { triangles: [NONE; 2], corners: [NONE; 2], count: 0 };
        for t in triangles.into_iter().filter(|&t| there(t)) {
            (gone.triangles[gone.count], gone.corners[gone.count]) = (t, third(t)?);
            gone.count += 1;
        }
        let (pairs, thirds) = (gone.triangles(), gone.corners());
        if pairs.is_empty() {
            return None;
        }
        let Self { own, other, .. } = self;
        // The fans that have these triangles: a vertex of the base may have more.
        let corner = |v: u32| (3 * pairs[0]..3 * pairs[0] + 3).find(|&c| s.vertex(c) == v).unwrap_or(NONE);
        own.gather(s, corner(blue));
        other.gather(s, corner(red));
        let two = pairs.len() == 2;
        let has_all = |r: &Ring| pairs.iter().all(|&t| r.corners.iter().any(|c| c / 3 == t));
        if own.closed != two || (!two && other.closed) || !has_all(own) || !has_all(other) {
            return None;
        }
        if own.corners.len().saturating_mul(other.corners.len()) > RINGS_LIMIT {
            return None;
        }
        let is_third = |v: u32| thirds.iter().any(|&c| s.vertex(c) == v);
        let met = |v: &&u32| **v != red && **v != blue && own.vertices.contains(v);
        if other.vertices.iter().filter(met).any(|&v| !is_third(v)) || (two && s.vertex(thirds[0]) == s.vertex(thirds[1])) {
            return None;
        }
        let left = (own.corners.len() + other.corners.len()).saturating_sub(2 * pairs.len());
        if left < if other.closed { 3 } else { 1 } {
            return None;
        }
        if thirds.iter().any(|&c| is_thin(s, c)) {
            return None;
        }
        Some(gone)
    }

    /// Panics unless what is across from each edge is, and the triangles about each vertex of a split or collapse are one fan; tests call it. O(triangles).
    pub fn check_invariants(&self) {
        let s = &self.surface;
        let mut shown: Vec<u32> = (0..s.triangles.len() as u32).filter(|&t| s.triangles[t as usize][0] != NONE).collect();
        let mut listed = self.shown.clone();
        listed.sort_unstable();
        assert_eq!(shown, listed);
        let mut edges = std::collections::HashSet::new();
        for t in shown.drain(..) {
            for c in 3 * t..3 * t + 3 {
                let (v, w) = (s.vertex(c), s.vertex(next(c)));
                assert!(v != w && edges.insert((v, w)), "edge {v} {w} is there twice");
                let other = s.across[c as usize];
                if other != NONE {
                    assert_eq!((s.across[other as usize], s.vertex(other), s.vertex(next(other))), (c, w, v));
                }
            }
        }
        let mut triangles = std::collections::HashMap::new();
        for c in listed.iter().flat_map(|&t| 3 * t..3 * t + 3) {
            *triangles.entry(s.vertex(c)).or_insert(0) += 1;
        }
        for (v, count) in triangles {
            assert_eq!(s.around(s.corner_of[v as usize]).count(), count, "the triangles about {v} are not one fan");
        }
    }
}

/// Makes two edges each other's other side; `b` may be [`NONE`].
fn pair(s: &mut Surface, a: u32, b: u32) {
    s.across[a as usize] = b;
    if b != NONE {
        s.across[b as usize] = a;
    }
}
