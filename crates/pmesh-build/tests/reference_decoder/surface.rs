//! Section 5: corners, fans and splits of the surface.

use super::{Mesh, NONE};
use std::collections::HashMap;

pub fn next(c: usize) -> usize {
    if c % 3 == 2 { c - 2 } else { c + 1 }
}
pub fn previous(c: usize) -> usize {
    if c.is_multiple_of(3) { c + 2 } else { c - 1 }
}
pub fn vertex(mesh: &Mesh, c: usize) -> usize {
    mesh.triangles[c / 3][c % 3]
}

/// The corners of a fan, counter-clockwise, and the vertices around them.
pub struct Fan {
    pub corners: Vec<usize>,
    pub closed: bool,
    pub ring: Vec<usize>,
}

pub struct Surface {
    pub across: Vec<usize>,
    pub corner_of: Vec<usize>,
}

impl Surface {
    /// 5.2.
    pub fn new(mesh: &Mesh) -> Self {
        let corners = 3 * mesh.triangles.len();
        let mut with_edge: HashMap<(usize, usize), Vec<usize>> = HashMap::new();
        let mut corner_of = vec![NONE; mesh.count()];
        for c in (0..corners).rev() {
            with_edge.entry((vertex(mesh, c), vertex(mesh, next(c)))).or_default().push(c);
            corner_of[vertex(mesh, c)] = c;
        }
        let mut across = vec![NONE; corners];
        for i in 0..corners {
            let (a, b) = (vertex(mesh, i), vertex(mesh, next(i)));
            let there = with_edge.get(&(a, b)).map_or(0, Vec::len);
            if let Some([j]) = with_edge.get(&(b, a)).map(Vec::as_slice)
                && a != b
                && there == 1
                && i / 3 != *j / 3
            {
                across[i] = *j;
            }
        }
        Self { across, corner_of }
    }

    fn turn(&self, c: usize) -> usize {
        self.across[previous(c)]
    }
    fn turn_back(&self, c: usize) -> usize {
        if self.across[c] == NONE { NONE } else { next(self.across[c]) }
    }

    /// 5.3. `start` is a corner. (No fan has more corners than there are; the bounds only see to it that this ends.)
    pub fn around(&self, mesh: &Mesh, start: usize) -> Fan {
        let most = self.across.len();
        let mut first = start;
        for _ in 0..most {
            let t = self.turn_back(first);
            if t == NONE {
                break;
            }
            if t == start {
                first = start;
                break;
            }
            first = t;
        }
        let mut corners = vec![first];
        let mut last = first;
        while self.turn(last) != NONE && self.turn(last) != first && corners.len() < most {
            last = self.turn(last);
            corners.push(last);
        }
        let closed = self.turn(last) != NONE;
        let mut ring: Vec<usize> = corners.iter().map(|&c| vertex(mesh, next(c))).collect();
        if !closed {
            ring.push(vertex(mesh, previous(last)));
        }
        Fan { corners, closed, ring }
    }

    fn pair(&mut self, a: usize, b: usize) {
        self.across[a] = b;
        if b != NONE {
            self.across[b] = a;
        }
    }
    fn append(&mut self, mesh: &mut Mesh, triangle: [usize; 3]) {
        mesh.triangles.push(triangle);
        self.across.extend([NONE; 3]);
    }
    fn give(mesh: &mut Mesh, corners: &[usize], v: usize) {
        for c in corners {
            mesh.triangles[c / 3][c % 3] = v;
        }
    }

    /// 5.4. `v` is the new vertex, the corners `moving` of `p` go to it.
    pub fn split_inside(&mut self, mesh: &mut Mesh, v: usize, p: usize, moving: &[usize]) {
        let (first, last) = (moving[0], moving[moving.len() - 1]);
        let (start, end) = (vertex(mesh, next(first)), vertex(mesh, previous(last)));
        let (outer_first, outer_last) = (self.across[first], self.across[previous(last)]);
        Self::give(mesh, moving, v);
        let one = 3 * mesh.triangles.len();
        let two = one + 3;
        self.append(mesh, [v, p, start]);
        self.append(mesh, [v, end, p]);
        self.pair(one, two + 2);
        self.pair(one + 1, outer_first);
        self.pair(one + 2, first);
        self.pair(two + 1, outer_last);
        self.pair(two, previous(last));
        self.corner_of.push(first);
        self.corner_of[p] = one + 1;
    }

    /// 5.5, at the head of a fan. `nm`: the last vertex of the arc.
    pub fn split_head(&mut self, mesh: &mut Mesh, v: usize, p: usize, moving: &[usize], nm: usize, beside: Option<usize>) {
        let one = 3 * mesh.triangles.len();
        Self::give(mesh, moving, v);
        self.append(mesh, [v, nm, p]);
        if let Some(&last) = moving.last() {
            self.pair(one, previous(last));
        }
        if let Some(beside) = beside {
            self.pair(one + 1, beside);
        }
        self.corner_of[p] = one + 2;
        self.corner_of.push(one);
    }

    /// 5.5, at the tail of a fan. `n0`: the first vertex of the arc.
    pub fn split_tail(&mut self, mesh: &mut Mesh, v: usize, p: usize, moving: &[usize], n0: usize, beside: Option<usize>) {
        let one = 3 * mesh.triangles.len();
        Self::give(mesh, moving, v);
        self.append(mesh, [v, p, n0]);
        if let Some(&first) = moving.first() {
            self.pair(one + 2, first);
        }
        if let Some(beside) = beside {
            self.pair(one + 1, previous(beside));
        }
        self.corner_of[p] = one + 1;
        self.corner_of.push(one);
    }
}
