//! Triangles that a finer level replaces: a patch filled anew in a way that no representative can express.
//!
//! Such a mesh keeps them at coarser levels and leaves them out from the level on that retires them. A level is then no longer a
//! prefix of the triangles alone: whoever draws or copies one leaves out what is retired there.

use crate::{MeshError, ProgressiveMultilevelMesh};
use std::collections::HashMap;

/// The step, counted from the coarsest level, from which on a triangle is gone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Retired(HashMap<u32, u32>);

impl Retired {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }
    /// True if the triangle is gone at that step.
    pub(crate) fn at(&self, triangle: u32, step: u32) -> bool {
        self.0.get(&triangle).is_some_and(|&from| from <= step)
    }
    /// Checks what a part retires: triangles of earlier levels (the first `known`), each once.
    pub(crate) fn check(&self, part: &[u32], known: u32) -> Result<(), MeshError> {
        let mut sorted = part.to_vec();
        sorted.sort_unstable();
        let twice = sorted.windows(2).find(|w| w[0] == w[1]).map(|w| w[0]);
        let bad = twice.or_else(|| part.iter().copied().find(|&t| t >= known || self.0.contains_key(&t)));
        bad.map_or(Ok(()), |triangle| Err(MeshError::BadRetirement { triangle }))
    }
    pub(crate) fn add(&mut self, part: &[u32], step: u32) {
        self.0.extend(part.iter().map(|&t| (t, step)));
    }
    /// Triangles with the step at which they go.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, u32)> {
        self.0.iter().map(|(&t, &step)| (t, step))
    }
}

impl ProgressiveMultilevelMesh {
    /// True if some level replaces triangles of coarser ones.
    pub fn has_retired(&self) -> bool {
        !self.retired.is_empty()
    }
    /// True if triangle `triangle`, though among the first of `level`, has been replaced there. O(1).
    pub fn is_retired_at(&self, triangle: u32, level: u32) -> bool {
        !self.retired.is_empty() && self.retired.at(triangle, self.level_count().saturating_sub(1).saturating_sub(level))
    }
    /// Triangles that are gone at one of two levels and not at the other. O(retired triangles).
    pub fn retired_between(&self, level: u32, other: u32) -> Vec<u32> {
        let differs = |&(t, _): &(u32, u32)| self.is_retired_at(t, level) != self.is_retired_at(t, other);
        self.retired.iter().filter(differs).map(|(t, _)| t).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Level, MeshError, ProgressiveMultilevelMesh, Vertices};

    fn level(positions: &[[f32; 3]], triangles: &[[u32; 3]], retired: &[u32]) -> Level {
        let vertices = Vertices { positions: positions.to_vec(), ..Default::default() };
        Level { vertices, triangles: triangles.to_vec(), retired: retired.to_vec(), ..Default::default() }
    }

    #[test]
    fn only_triangles_of_earlier_levels_are_replaced_and_once() {
        let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        mesh.add_level(&level(&corners, &[[0, 1, 2], [0, 2, 1]], &[])).expect("it is valid");
        for bad in [&[2][..], &[0, 0]] {
            let refused = mesh.add_level(&level(&[], &[[1, 2, 0]], bad));
            assert!(matches!(refused, Err(MeshError::BadRetirement { .. })), "{bad:?}");
            assert_eq!((mesh.arrived_levels(), mesh.triangles().len()), (1, 2));
        }
        mesh.add_level(&level(&[], &[[1, 2, 0]], &[1])).expect("it is valid");
        mesh.check_invariants();
        assert!(matches!(mesh.add_level(&level(&[], &[], &[1])), Err(MeshError::BadRetirement { triangle: 1 })));
        assert_eq!(mesh.triangles_at(1), Ok(vec![[0, 1, 2], [0, 2, 1]]));
        assert_eq!(mesh.triangles_at(0), Ok(vec![[0, 1, 2], [1, 2, 0]]));
        assert_eq!((mesh.triangle_count(1), mesh.triangle_count(0)), (Ok(2), Ok(2)));
        assert_eq!(mesh.retired_between(0, 1), [1]);
    }
}
