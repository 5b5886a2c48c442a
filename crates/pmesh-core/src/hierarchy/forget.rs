//! Letting go of what is known but not shown.

use super::front::Known;
use super::{Front, NONE};

impl Front {
    /// Forgets all nodes below the front: what is shown stays, memory is given back, and what is needed again must be learnt again. Numbers of nodes, vertices and
    /// triangles are others after it, so all of them count as changed. Gives the new number of each
    /// split (of the node pair from `root_count() + 2 i` on), or `None` if it is forgotten. O(known).
    pub fn forget_below(&mut self) -> Vec<Option<u32>> {
        if self.order.is_some() {
            return (0..self.cuts.len() as u32).map(Some).collect();
        }
        let roots = self.roots as usize;
        // Of each node: something below it is in the front.
        let mut is_above = vec![false; self.known.len()];
        for i in (0..self.known.len()).rev() {
            let Known { parent, at, .. } = self.known[i];
            if parent != NONE && (at != NONE || is_above[i]) {
                is_above[parent as usize] = true;
            }
        }
        // New number of each split that stays.
        let mut count = 0u32;
        let pairs = self.known[roots..].chunks_exact(2).map(|pair| is_above[pair[0].parent as usize]);
        let mut following = || {
            count += 1;
            count - 1
        };
        let splits: Vec<Option<u32>> = pairs.map(|stays| stays.then(&mut following)).collect();
        let node = |i: u32| match i.checked_sub(self.roots) {
            None => Some(i),
            Some(below) => splits[below as usize / 2].map(|n| self.roots + 2 * n + below % 2),
        };
        let (first_vertex, first_triangle) = (self.roots, self.base_triangles);
        let vertex = |v: u32| match v.checked_sub(first_vertex) {
            None => Some(v),
            Some(n) => splits.get(n as usize).copied().flatten().map(|n| first_vertex + n),
        };
        let triangle = |t: u32| match t.checked_sub(first_triangle) {
            None => Some(t),
            Some(n) => splits.get(n as usize / 2).copied().flatten().map(|k| first_triangle + 2 * k + n % 2),
        };
        let or_none = |i: Option<u32>| i.unwrap_or(NONE);
        let renamed = |(i, k): (usize, &Known)| {
            node(i as u32)?;
            let link = |n: u32| if n == NONE { NONE } else { or_none(node(n)) };
            Some(Known { parent: link(k.parent), child: link(k.child), vertex: or_none(vertex(k.vertex)), ..*k })
        };
        let known: Vec<Known> = self.known.iter().enumerate().filter_map(renamed).collect();
        let front = self.front.iter().map(|&i| or_none(node(i))).collect();
        let keep = |n: usize| splits[n].is_some();
        self.cuts = self.cuts.iter().enumerate().filter(|(n, _)| keep(*n)).map(|(_, c)| *c).collect();
        self.near = self.cuts.iter().map(|cuts| cuts.map(|c| if c.node == 0 { NONE } else { c.tree })).collect();
        let positions = self.positions.iter().enumerate();
        self.positions = positions.filter(|(v, _)| *v < roots || keep(*v - roots)).map(|(_, p)| *p).collect();
        self.mesh.rename(vertex, triangle, (first_vertex + count, first_triangle + 2 * count));
        if let Some(g) = &mut self.geomorphs {
            g.rename(vertex);
        }
        (self.known, self.front, self.cursor) = (known, front, 0);
        self.wanted.clear();
        if self.whole.is_some() {
            self.follow_cuts();
        }
        splits
    }
}
