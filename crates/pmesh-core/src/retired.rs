//! Triangles that a finer level replaces: a patch filled anew in a way that no representative can express.
//!
//! Such a mesh keeps them at coarser levels and leaves them out from the level on that retires them. A level is then no longer a
//! prefix of the triangles alone: whoever draws or copies one leaves out what is retired there.

use crate::{MeshError, ProgressiveMultilevelMesh};

const NEVER: u32 = u32::MAX;

/// The step, counted from the coarsest level, from which on each triangle is gone; empty while none is.
#[derive(Clone, Debug, Default)]
pub(crate) struct Retired {
    from: Vec<u32>,
    count: u32,
}

impl Retired {
    pub(crate) fn count(&self) -> u32 {
        self.count
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        self.from.capacity() * 4
    }
    /// True if the triangle is gone at that step.
    pub(crate) fn at(&self, triangle: u32, step: u32) -> bool {
        self.from.get(triangle as usize).is_some_and(|&from| from <= step)
    }
    /// Notes that a part replaces triangles of earlier levels (the first `known`), each once; on an error nothing is noted.
    pub(crate) fn add(&mut self, part: &[u32], known: u32, step: u32) -> Result<(), MeshError> {
        if part.is_empty() {
            return Ok(());
        }
        self.from.resize(self.from.len().max(known as usize), NEVER);
        for (i, &triangle) in part.iter().enumerate() {
            match self.from.get_mut(triangle as usize).filter(|f| triangle < known && **f == NEVER) {
                Some(from) => *from = step,
                None => {
                    part[..i].iter().for_each(|&t| self.from[t as usize] = NEVER);
                    return Err(MeshError::BadRetirement { triangle });
                }
            }
        }
        self.count += part.len() as u32;
        Ok(())
    }
    pub(crate) fn undo(&mut self, part: &[u32]) {
        part.iter().for_each(|&t| self.from[t as usize] = NEVER);
        self.count -= part.len() as u32;
    }
}

impl ProgressiveMultilevelMesh {
    /// True if some level replaces triangles of coarser ones.
    pub fn has_retired(&self) -> bool {
        self.retired.count() > 0
    }
    /// True if triangle `triangle`, though among the first of `level`, has been replaced there. O(1).
    pub fn is_retired_at(&self, triangle: u32, level: u32) -> bool {
        self.retired.at(triangle, self.level_count().saturating_sub(1).saturating_sub(level))
    }
    /// Triangles that are gone at one of two levels and not at the other. O(triangles).
    pub fn retired_between(&self, level: u32, other: u32) -> Vec<u32> {
        let differs = |&t: &u32| self.is_retired_at(t, level) != self.is_retired_at(t, other);
        (0..self.triangles.len() as u32).filter(differs).collect()
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
