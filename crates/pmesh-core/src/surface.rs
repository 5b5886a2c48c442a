//! Triangles that know what lies across their edges (C.10).

mod builder;
mod canonical;

pub use builder::SurfaceBuilder;
pub use canonical::CanonicalOrder;

use crate::turned;
use std::collections::HashMap;

/// Stands for "nothing there".
pub const NONE: u32 = u32::MAX;

/// The corner after `c` in its triangle.
#[inline(always)]
pub fn next(c: u32) -> u32 {
    if c % 3 == 2 { c - 2 } else { c + 1 }
}
/// The corner before `c` in its triangle.
#[inline(always)]
pub fn previous(c: u32) -> u32 {
    if c.is_multiple_of(3) { c + 2 } else { c - 1 }
}

/// A mesh of which corner `c = 3 t + k` stands at vertex `k` of triangle `t` and names the edge from there to the next.
#[derive(Clone, Debug, Default)]
pub struct Surface {
    /// Corners of each triangle; [`NONE`] in those that [`Self::replace`] has taken out.
    pub triangles: Vec<[u32; 3]>,
    /// For each edge the same edge seen from the other side, or [`NONE`] at a boundary and where more than two triangles or
    /// two of unlike orientation meet.
    pub across: Vec<u32>,
    /// A corner of each vertex, or [`NONE`].
    pub corner_of: Vec<u32>,
}

/// What a new vertex is put into: the triangles around its representative, in order (C.6).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fan {
    /// Vertex that all triangles share.
    pub apex: u32,
    /// The triangles' corners at the apex, counter-clockwise; each triangle is (apex, bᵢ, bᵢ₊₁).
    pub corners: Vec<u32>,
    /// The other vertices of the hole: one more than triangles.
    pub chain: Vec<u32>,
}

impl Surface {
    /// Finds what lies across each edge. O(triangles).
    pub fn new(triangles: Vec<[u32; 3]>, vertex_count: u32) -> Self {
        let mut builder = SurfaceBuilder::new(triangles, vertex_count);
        while !builder.step(usize::MAX) {}
        builder.surface
    }
    /// Room for so many vertices and triangles more.
    pub fn reserve(&mut self, vertices: usize, triangles: usize) {
        self.across.reserve_exact(3 * triangles);
        self.triangles.reserve_exact(triangles);
        self.corner_of.reserve_exact(vertices);
    }
    /// Number of each triangle by its corners, [`turned`].
    pub fn places(&self) -> HashMap<[u32; 3], u32> {
        self.triangles.iter().enumerate().map(|(t, &v)| (turned(v), t as u32)).collect()
    }
    /// Vertex at a corner.
    #[inline(always)]
    pub fn vertex(&self, c: u32) -> u32 {
        self.triangles.as_flattened()[c as usize]
    }
    /// Counter-clockwise from corner `c` about its vertex.
    #[inline(always)]
    pub fn turn(&self, c: u32) -> u32 {
        self.across[previous(c) as usize]
    }
    /// Clockwise from corner `c` about its vertex.
    #[inline(always)]
    pub fn turn_back(&self, c: u32) -> u32 {
        match self.across[c as usize] {
            NONE => NONE,
            other => next(other),
        }
    }

    /// Corners of one fan about the vertex of corner `start`, counter-clockwise: from `start` if the fan is closed, else from its
    /// clockwise-most corner. Ends, since what lies across edges is paired.
    #[inline]
    pub fn around(&self, start: u32) -> impl Iterator<Item = u32> {
        let mut first = start;
        loop {
            match self.turn_back(first) {
                NONE => break,
                c if c == start => {
                    first = start;
                    break;
                }
                c => first = c,
            }
        }
        let after = move |&c: &u32| Some(self.turn(c)).filter(|&c| c != NONE && c != first);
        std::iter::successors(Some(first), after)
    }

    /// Lists the corners of the fan about `v`, as [`Self::around`], and the vertices about it; gives how many corners, and whether it
    /// is closed. `None` if there are none, or no room for them and one vertex more.
    pub fn fan_of<const N: usize>(&self, v: u32, fan: &mut [u32; N], ring: &mut [u32; N]) -> Option<(usize, bool)> {
        let start = self.corner_of[v as usize];
        if start == NONE {
            return None;
        }
        let (vertices, across) = (self.triangles.as_flattened(), &self.across[..]);
        let (mut c, mut count) = (start, 0);
        while count + 1 < N {
            let k = c % 3;
            let (after, before) = (if k == 2 { c - 2 } else { c + 1 }, if k == 0 { c + 2 } else { c - 1 });
            fan[count] = c;
            ring[count] = vertices[after as usize];
            count += 1;
            c = across[before as usize];
            if c == start {
                return Some((count, true));
            }
            if c == NONE {
                ring[count] = vertices[before as usize];
                return self.complete_fan(start, count, fan, ring).map(|count| (count, false));
            }
        }
        None
    }
    /// Puts what lies clockwise of the first corner in front; gives how many corners there are then.
    fn complete_fan<const N: usize>(
        &self,
        start: u32,
        mut count: usize,
        fan: &mut [u32; N],
        ring: &mut [u32; N],
    ) -> Option<usize> {
        let mut c = self.turn_back(start);
        let mut found = 0;
        while c != NONE {
            if count + 2 > N - 1 {
                return None;
            }
            fan[count] = c;
            ring[count + 1] = self.vertex(next(c));
            (count, found) = (count + 1, found + 1);
            c = self.turn_back(c);
        }
        fan[count - found..count].reverse();
        fan[..count].rotate_right(found);
        ring[count + 1 - found..=count].reverse();
        ring[..=count].rotate_right(found);
        Some(count)
    }

    /// The fan that triangles `region` make, its apex the lowest vertex that can be one; `None` if they make none: the only
    /// shape that one representative can express.
    pub fn fan(&self, region: &[u32]) -> Option<Fan> {
        let mut apexes = self.triangles[*region.first()? as usize];
        apexes.sort_unstable();
        apexes.into_iter().find_map(|apex| self.fan_about(apex, region))
    }
    fn fan_about(&self, apex: u32, region: &[u32]) -> Option<Fan> {
        let corner_in = |t: u32| {
            let at = self.triangles[t as usize].iter().position(|&v| v == apex)?;
            Some(3 * t + at as u32)
        };
        let corners = region.iter().map(|&t| corner_in(t)).collect::<Option<Vec<_>>>()?;
        let mut sorted = corners.clone();
        sorted.sort_unstable();
        let inside = |c: u32| sorted.binary_search(&c).is_ok();
        let first = *corners.iter().find(|&&c| !inside(self.turn_back(c)))?;
        let mut fan = Fan { apex, corners: vec![first], chain: vec![self.vertex(next(first))] };
        let mut c = first;
        loop {
            fan.chain.push(self.vertex(previous(c)));
            c = self.turn(c);
            if !inside(c) {
                break;
            }
            fan.corners.push(c);
        }
        let mut distinct = fan.chain.clone();
        distinct.push(apex);
        distinct.sort_unstable();
        let simple = distinct.windows(2).all(|w| w[0] != w[1]);
        (fan.corners.len() == region.len() && simple).then_some(fan)
    }

    /// The boundary of `region`, counter-clockwise, as the corners at which its edges begin; `None` unless the triangles are a
    /// disk without a vertex inside: edge to edge, no vertex met twice.
    pub fn boundary(&self, region: &[u32]) -> Option<Vec<u32>> {
        let mut sorted = region.to_vec();
        sorted.sort_unstable();
        let inside = |c: u32| c != NONE && sorted.binary_search(&(c / 3)).is_ok();
        let corners = || region.iter().flat_map(|&t| 3 * t..3 * t + 3);
        let first = corners().find(|&c| !inside(self.across[c as usize]))?;
        let mut rim = vec![first];
        loop {
            // Clockwise about the edge's end, as long as there is region.
            let mut at = next(rim[rim.len() - 1]);
            for _ in 0..region.len() {
                match self.across[at as usize] {
                    other if inside(other) => at = next(other),
                    _ => break,
                }
            }
            if at == first {
                break;
            }
            rim.push(at);
            if rim.len() > region.len() + 2 {
                return None;
            }
        }
        let mut vertices: Vec<u32> = rim.iter().map(|&c| self.vertex(c)).collect();
        vertices.sort_unstable();
        let simple = vertices.windows(2).all(|w| w[0] != w[1]);
        // Sides and triangles of a disk whose vertices all lie on its rim.
        (simple && rim.len() == region.len() + 2).then_some(rim)
    }

    /// Takes the triangles of a disk out and joins its rim, as [`Self::boundary`] gives it, to a new vertex. Gives the vertex; its
    /// triangles are the last ones. O(rim).
    pub fn replace(&mut self, region: &[u32], rim: &[u32]) -> u32 {
        let v = self.corner_of.len() as u32;
        let first = self.triangles.len() as u32 * 3;
        let count = rim.len() as u32;
        self.corner_of.push(first + 2);
        let around: Vec<(u32, u32)> = rim.iter().map(|&c| (self.vertex(c), self.across[c as usize])).collect();
        for (i, &(a, other)) in around.iter().enumerate() {
            let (i, b) = (i as u32, around[(i + 1) % around.len()].0);
            let corner = first + 3 * i;
            self.triangles.push([a, b, v]);
            // To the triangle before, and to the one after.
            self.across.extend([other, first + 3 * ((i + 1) % count) + 2, first + 3 * ((i + count - 1) % count) + 1]);
            if other != NONE {
                self.across[other as usize] = corner;
            }
            self.corner_of[a as usize] = corner;
        }
        for &t in region {
            self.triangles[t as usize] = [NONE; 3];
            self.across[3 * t as usize..3 * t as usize + 3].fill(NONE);
        }
        v
    }

    /// Puts a new vertex into a fan: its triangles leave the apex for the vertex, two triangles join the vertex to the apex.
    /// Gives the vertex. O(fan).
    pub fn insert(&mut self, fan: &Fan) -> u32 {
        let v = self.corner_of.len() as u32;
        let (first, last) = (fan.corners[0], fan.corners[fan.corners.len() - 1]);
        let (start, end) = (fan.chain[0], fan.chain[fan.chain.len() - 1]);
        let (outer_first, outer_last) = (self.across[first as usize], self.across[previous(last) as usize]);
        for &c in &fan.corners {
            self.triangles[c as usize / 3][c as usize % 3] = v;
        }
        let one = self.triangles.len() as u32 * 3;
        let two = one + 3;
        self.triangles.extend([[v, fan.apex, start], [v, end, fan.apex]]);
        self.across.extend([NONE; 6]);
        let mut pair = |a: u32, b: u32| {
            self.across[a as usize] = b;
            if b != NONE {
                self.across[b as usize] = a;
            }
        };
        pair(one, two + 2);
        pair(one + 1, outer_first);
        pair(one + 2, first);
        pair(two + 1, outer_last);
        pair(two, previous(last));
        self.corner_of.push(first);
        self.corner_of[fan.apex as usize] = one + 1;
        v
    }
}

impl Surface {
    /// Puts a new vertex at the boundary: the triangles of `fan`, from its apex's first (`head`) or up to its last, leave the apex
    /// for the vertex, and one triangle joins the vertex to the apex. `beside` is the apex's corner next to them, if it keeps
    /// one; the fan may have no triangle. Gives the vertex. O(fan).
    pub fn insert_at_boundary(&mut self, fan: &Fan, head: bool, beside: Option<u32>) -> u32 {
        let v = self.corner_of.len() as u32;
        for &c in &fan.corners {
            self.triangles[c as usize / 3][c as usize % 3] = v;
        }
        let one = self.triangles.len() as u32 * 3;
        // The edge between the vertex's triangles and the new one, that between the new one and the apex's.
        let (corners, own, kept) = if head {
            ([v, fan.chain[fan.chain.len() - 1], fan.apex], fan.corners.last().map(|&c| previous(c)), beside)
        } else {
            ([v, fan.apex, fan.chain[0]], fan.corners.first().copied(), beside.map(previous))
        };
        self.triangles.push(corners);
        self.across.extend([NONE; 3]);
        let (to_own, to_kept, apex) = if head { (one, one + 1, one + 2) } else { (one + 2, one + 1, one + 1) };
        for (a, b) in [(to_own, own), (to_kept, kept)] {
            if let Some(b) = b {
                self.across[a as usize] = b;
                self.across[b as usize] = a;
            }
        }
        self.corner_of.push(one);
        self.corner_of[fan.apex as usize] = apex;
        v
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FC01's Figure 5, repaired, as SEEDS C.11 and C.12 have it: vertices, triangles of level 0.
    fn figure_5() -> Surface {
        Surface::new(vec![[4, 5, 2], [0, 4, 2], [4, 6, 5], [4, 8, 6], [3, 8, 4], [3, 7, 8], [1, 3, 4], [1, 4, 0]], 9)
    }

    #[test]
    fn g15_the_canonical_order_of_figure_5_makes_its_patches() {
        let mut surface = figure_5();
        let order = CanonicalOrder::of(&surface);
        let first = surface.fan(&order[0..2]);
        // Level 1's triIndex is [0 1]: in coordIndex order for level 0, which are the two triangles of quad 0 4 5 2.
        let fan = surface.fan(&[0, 1]).expect("a quad is a fan");
        assert!(first.is_some());
        assert_eq!(surface.insert(&fan), 9);
        assert_eq!((surface.corner_of.len(), surface.triangles.len()), (10, 10));
        let name = |t: &u32| {
            let mut vertices = surface.triangles[*t as usize];
            vertices.sort_unstable();
            match vertices {
                [0, 2, 9] => 'A',
                [2, 5, 9] => 'B',
                [4, 5, 9] => 'C',
                [0, 4, 9] => 'D',
                [4, 5, 6] => 'E',
                [4, 6, 8] => 'F',
                [3, 4, 8] => 'G',
                [3, 7, 8] => 'H',
                [1, 3, 4] => 'I',
                [0, 1, 4] => 'J',
                other => panic!("{other:?}"),
            }
        };
        let order = CanonicalOrder::of(&surface);
        assert_eq!(order.iter().map(name).collect::<String>(), "JDAIGFECBH");
        let patches: Vec<_> = order.chunks(3).take(3).map(|p| surface.fan(p).expect("a pentagon is a fan")).collect();
        patches.iter().for_each(|p| assert!(surface.insert(p) > 9));
        assert_eq!((surface.corner_of.len(), surface.triangles.len()), (13, 16));
        let again = Surface::new(surface.triangles.clone(), 13);
        assert_eq!(again.across, surface.across);
    }

    #[test]
    fn triangles_about_a_closed_vertex_or_in_two_pieces_are_no_fan() {
        let closed = Surface::new(vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]], 4);
        assert_eq!(closed.fan(&[0, 1, 2]), None);
        assert!(closed.fan(&[0, 1]).is_some());
        assert_eq!(figure_5().fan(&[0, 5]), None);
    }
}
