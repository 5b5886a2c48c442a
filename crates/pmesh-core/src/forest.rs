//! The forest of representatives (A.3, A.4): parents with lower indices, walked until a vertex falls inside a prefix.
//!
//! Two ways to walk it: [`compress`], the paper's path compression on a temporary copy, linear because parents come
//! first; and [`JumpForest`], Myers' skew-binary jump pointers, which bound one walk by the logarithm of the depth and
//! grow with the mesh: that is what the vertex shader walks.

/// Stands for "no representative".
pub const NO_REPRESENTATIVE: u32 = u32::MAX;

/// First ancestor of `v` below `count`, or the last vertex of the chain if none is. O(depth). The reference.
pub fn ancestor_below(parents: &[u32], mut v: u32, count: u32) -> u32 {
    while v >= count {
        match parents[v as usize] {
            NO_REPRESENTATIVE => break,
            parent => v = parent,
        }
    }
    v
}

/// For every vertex from `count` on, its first ancestor below `count` (or the root it ends at): entry `i` is vertex
/// `count + i`. One forward pass, O(vertices past the prefix).
pub fn compress(parents: &[u32], count: u32) -> Vec<u32> {
    let mut roots: Vec<u32> = Vec::with_capacity(parents.len().saturating_sub(count as usize));
    for (i, &parent) in parents.iter().enumerate().skip(count as usize) {
        roots.push(match parent {
            NO_REPRESENTATIVE => i as u32,
            p if p < count => p,
            p => roots[(p - count) as usize],
        });
    }
    roots
}

/// Parents with jump pointers: 8 bytes a vertex as the GPU reads them, 4 more for the depth.
#[derive(Clone, Debug, Default)]
pub struct JumpForest {
    /// (parent, jump) of each vertex; both [`NO_REPRESENTATIVE`] at a root. A jump is an ancestor, the parent or higher.
    pub links: Vec<[u32; 2]>,
    depths: Vec<u32>,
}

impl JumpForest {
    /// Appends the vertices that `parents` has beyond those known. O(new vertices).
    pub fn grow(&mut self, parents: &[u32]) {
        for &parent in &parents[self.links.len()..] {
            if parent == NO_REPRESENTATIVE {
                self.links.push([NO_REPRESENTATIVE; 2]);
                self.depths.push(0);
                continue;
            }
            let jump = self.links[parent as usize][1];
            let depth = |v: u32| self.depths[v as usize];
            // Two jumps of equal length above the parent: leap over both. Otherwise step to the parent.
            let leap = jump != NO_REPRESENTATIVE && {
                let second = self.links[jump as usize][1];
                second != NO_REPRESENTATIVE && depth(parent) - depth(jump) == depth(jump) - depth(second)
            };
            let to = if leap { self.links[jump as usize][1] } else { parent };
            let d = depth(parent) + 1;
            self.links.push([parent, to]);
            self.depths.push(d);
        }
    }

    /// As [`ancestor_below`], in O(log depth) steps. The second value is the number of steps.
    pub fn ancestor_below(&self, mut v: u32, count: u32) -> (u32, u32) {
        let mut steps = 0;
        while v >= count {
            let [parent, jump] = self.links[v as usize];
            if parent == NO_REPRESENTATIVE {
                break;
            }
            // A jump may not pass the first ancestor inside: take it only if it is still outside.
            v = if jump >= count { jump } else { parent };
            steps += 1;
        }
        (v, steps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn forest() -> impl Strategy<Value = Vec<u32>> {
        prop::collection::vec(any::<u32>(), 1..400).prop_map(|raw| {
            let parent = |(i, r): (usize, u32)| if i == 0 || r % 11 == 0 { NO_REPRESENTATIVE } else { r % i as u32 };
            raw.into_iter().enumerate().map(parent).collect()
        })
    }

    proptest! {
        #[test]
        fn every_walk_finds_the_same_ancestor(parents in forest(), cut in 0u32..400) {
            let count = cut.min(parents.len() as u32);
            let mut jumps = JumpForest::default();
            jumps.grow(&parents[..parents.len() / 2]);
            jumps.grow(&parents);
            let roots = compress(&parents, count);
            for v in 0..parents.len() as u32 {
                let expected = ancestor_below(&parents, v, count);
                prop_assert_eq!(jumps.ancestor_below(v, count).0, expected);
                if v >= count {
                    prop_assert_eq!(roots[(v - count) as usize], expected);
                }
            }
        }
    }

    #[test]
    fn a_chain_of_20_000_is_walked_in_logarithmic_steps() {
        let parents: Vec<u32> = (0..20_000u32).map(|i| i.wrapping_sub(1)).collect();
        let mut jumps = JumpForest::default();
        jumps.grow(&parents);
        for count in [1, 2, 77, 4_096, 19_000] {
            let (v, steps) = jumps.ancestor_below(19_999, count);
            assert_eq!(v, count - 1);
            assert!(steps <= 48, "{steps} steps");
        }
    }
}
