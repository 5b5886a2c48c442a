//! Growing the mesh: a level, or a part of one, is checked whole and then appended; a refused one changes nothing.

use crate::forest::NO_REPRESENTATIVE;
use crate::mesh::extend;
use crate::multilevel::LevelEnd;
use crate::versions::Versions;
use crate::{CornerMove, Level, MeshError, ProgressiveMultilevelMesh};
use std::collections::HashSet;

/// Most vertex entries, and most triangles: corner numbers (3 × triangle + corner) stay below 2^32 - 1.
const ENTRY_LIMIT: u64 = 1 << 30;
/// Most levels. A smooth stream has one a vertex.
const LEVEL_LIMIT: u64 = 1 << 28;

/// What an append changed beside adding to the ends of the arrays: for whoever mirrors them, as the renderer does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// Corners (3 × triangle + corner) of triangles known before that now hold another vertex.
    pub corners: Vec<u32>,
}

/// What a part becomes once checked.
struct Plan {
    /// Parents of the new vertices, as entries.
    parents: Vec<u32>,
    /// New triangles, corners at entries that have arrived.
    triangles: Vec<[u32; 3]>,
    /// (vertex that has not arrived, corner that waits for it).
    waiting: Vec<(u32, u32)>,
}

impl ProgressiveMultilevelMesh {
    /// Appends one whole level (A.15). O(level), plus O(triangles) if vertices move.
    pub fn add_level(&mut self, level: &Level) -> Result<Change, MeshError> {
        let mut change = self.append(level)?;
        change.corners.extend(self.complete_level()?.corners);
        Ok(change)
    }

    /// Appends a part of the level that is arriving; it shows once [`Self::complete_level`] is called, though what draws
    /// earlier levels may already be given the new arrays: prefixes do not see past themselves. O(part).
    pub fn append(&mut self, part: &Level) -> Result<Change, MeshError> {
        let named = self.note_future_representatives(part)?;
        let result = self.plan(part).and_then(|plan| {
            self.retired.add(&part.retired, self.ends.last().map_or(0, |e| e.triangles), self.arrived_levels())?;
            let moved = self.move_corners(part, &plan);
            moved.inspect_err(|_| self.retired.undo(&part.retired)).map(|corners| (plan, corners))
        });
        match result {
            Ok((plan, corners)) => Ok(self.apply(part, plan, corners)),
            Err(e) => {
                named.into_iter().for_each(|v| self.pending.forget(v));
                Err(e)
            }
        }
    }

    /// Ends the level that was appended in parts (an empty one is a level too, equal to the one before).
    pub fn complete_level(&mut self) -> Result<Change, MeshError> {
        if self.ends.len() as u64 >= LEVEL_LIMIT {
            return Err(MeshError::TooMany { what: "levels", count: LEVEL_LIMIT + 1, limit: LEVEL_LIMIT });
        }
        let moved = self.versions.as_mut().map(|v| v.complete()).unwrap_or_default();
        let mut corners = Vec::new();
        if !moved.is_empty() {
            // A table: one look a corner, however many vertices moved.
            let mut newest = vec![NO_REPRESENTATIVE; self.vertices.len()];
            moved.iter().for_each(|&(old, new)| newest[old as usize] = new);
            for (corner, v) in self.triangles.as_flattened_mut().iter_mut().enumerate() {
                let to = newest[*v as usize];
                if to != NO_REPRESENTATIVE {
                    *v = to;
                    corners.push(corner as u32);
                }
            }
        }
        let superseded = self.ends.last().map_or(0, |e| e.superseded) + moved.len() as u32;
        let (vertices, triangles) = (self.vertices.len() as u32, self.triangles.len() as u32);
        self.ends.push(LevelEnd { vertices, triangles, superseded, retired: self.retired.count() });
        Ok(Change { corners })
    }

    /// Number of vertices as the outside counts them, those of the open level included.
    fn logical_count(&self) -> u32 {
        self.versions.as_ref().map_or(self.vertices.len() as u32, |v| v.vertex_count())
    }
    fn entry(&self, vertex: u32) -> u32 {
        self.versions.as_ref().map_or(vertex, |v| v.current(vertex))
    }
    /// First entry of the level that is arriving.
    pub(crate) fn level_start(&self) -> u32 {
        self.ends.last().map_or(0, |e| e.vertices)
    }

    fn note_future_representatives(&mut self, part: &Level) -> Result<Vec<u32>, MeshError> {
        let entries = (self.vertices.len() + part.vertices.len() + part.moved.ids.len()) as u64;
        let triangles = self.triangles.len() as u64 + part.triangles.len() as u64;
        for (what, count) in [("vertices", entries), ("triangles", triangles)] {
            if count > ENTRY_LIMIT {
                return Err(MeshError::TooMany { what, count, limit: ENTRY_LIMIT });
            }
        }
        let arrived = self.logical_count() + part.vertices.len() as u32;
        let mut named = Vec::new();
        for &(v, r) in part.representatives.iter().filter(|p| p.0 >= arrived) {
            if let Err(e) = self.pending.insert(v, r) {
                named.into_iter().for_each(|v| self.pending.forget(v));
                return Err(e);
            }
            named.push(v);
        }
        Ok(named)
    }

    fn plan(&self, part: &Level) -> Result<Plan, MeshError> {
        let first = self.logical_count();
        part.vertices.check(self.attribute_set, first)?;
        part.moved.values.check(self.attribute_set, first)?;
        self.check_moves(part)?;
        self.check_seams(part)?;
        let parents = self.plan_parents(part)?;
        let mut plan = Plan { parents, triangles: Vec::with_capacity(part.triangles.len()), waiting: Vec::new() };
        let arrived = first + part.vertices.len() as u32;
        for (i, triangle) in part.triangles.iter().enumerate() {
            let t = (self.triangles.len() + i) as u32;
            let mut present = [0; 3];
            for (k, &vertex) in triangle.iter().enumerate() {
                let found = self.pending.resolve(vertex, arrived)?;
                let v = found.ok_or(MeshError::MissingVertex { triangle: t, vertex })?;
                if vertex >= arrived {
                    plan.waiting.push((vertex, 3 * t + k as u32));
                }
                present[k] = self.entry_of_new_or_old(v, first);
            }
            plan.triangles.push(present);
        }
        Ok(plan)
    }

    fn entry_of_new_or_old(&self, vertex: u32, first_new: u32) -> u32 {
        match vertex.checked_sub(first_new) {
            Some(i) => self.vertices.len() as u32 + i,
            None => self.entry(vertex),
        }
    }

    fn plan_parents(&self, part: &Level) -> Result<Vec<u32>, MeshError> {
        let first = self.logical_count();
        let n = part.vertices.len() as u32;
        let start = self.level_start();
        let known = |i: u32| self.pending.representative(first + i).unwrap_or(NO_REPRESENTATIVE);
        let mut parents: Vec<u32> = (0..n).map(known).collect();
        for &(vertex, representative) in part.representatives.iter().filter(|p| p.0 < first + n) {
            let Some(i) = vertex.checked_sub(first) else {
                return Err(MeshError::SecondRepresentative { vertex, representative });
            };
            if parents[i as usize] != NO_REPRESENTATIVE {
                return Err(MeshError::SecondRepresentative { vertex, representative });
            }
            if representative >= vertex {
                return Err(MeshError::BadRepresentative { vertex, representative });
            }
            parents[i as usize] = representative;
        }
        for (i, parent) in parents.iter_mut().enumerate().filter(|(_, p)| **p != NO_REPRESENTATIVE) {
            let (vertex, representative) = (first + i as u32, *parent);
            if representative >= first || self.entry(representative) >= start {
                return Err(MeshError::BadRepresentative { vertex, representative });
            }
            *parent = self.entry(representative);
        }
        Ok(parents)
    }

    fn check_moves(&self, part: &Level) -> Result<(), MeshError> {
        let ids = &part.moved.ids;
        if ids.len() != part.moved.values.len() {
            return Err(MeshError::AttributeLength { array: "moved", expected: ids.len(), got: part.moved.values.len() });
        }
        let mut seen = HashSet::new();
        for &vertex in ids {
            let earlier = vertex < self.logical_count() && self.entry(vertex) < self.level_start();
            let again = self.versions.as_ref().is_some_and(|v| v.moves_in_open_level(vertex));
            if !earlier || again || !seen.insert(vertex) {
                return Err(MeshError::BadMove { vertex });
            }
        }
        Ok(())
    }

    fn check_seams(&self, part: &Level) -> Result<(), MeshError> {
        let first = self.logical_count();
        let mut last = None;
        for &(vertex, position_of) in &part.position_of {
            let new = vertex >= first && vertex - first < part.vertices.len() as u32;
            if !new || position_of >= vertex || last.is_some_and(|l| l >= vertex) {
                return Err(MeshError::BadSharedPosition { vertex, position_of });
            }
            let other = match position_of.checked_sub(first) {
                Some(i) => part.vertices.positions[i as usize],
                None => self.vertices.positions[self.entry(position_of) as usize],
            };
            if part.vertices.positions[(vertex - first) as usize] != other {
                return Err(MeshError::BadSharedPosition { vertex, position_of });
            }
            last = Some(vertex);
        }
        Ok(())
    }

    /// Moves the corners one after the other, so that each sees the ones before; undoes all if one is refused.
    fn move_corners(&mut self, part: &Level, plan: &Plan) -> Result<Vec<u32>, MeshError> {
        let mut done: Vec<(CornerMove, u32)> = Vec::with_capacity(part.corner_moves.len());
        for m in &part.corner_moves {
            match self.move_corner(m, part, plan) {
                Ok(before) => done.push((*m, before)),
                Err(reason) => {
                    for (m, before) in done.into_iter().rev() {
                        self.triangles[m.triangle as usize][m.corner as usize] = before;
                    }
                    let CornerMove { triangle, corner, vertex } = *m;
                    return Err(MeshError::BadCornerMove { triangle, corner, vertex, reason });
                }
            }
        }
        Ok(done.iter().map(|(m, _)| 3 * m.triangle + u32::from(m.corner)).collect())
    }

    fn move_corner(&mut self, m: &CornerMove, part: &Level, plan: &Plan) -> Result<u32, &'static str> {
        let first = self.logical_count();
        let (entry, parent) = match m.vertex.checked_sub(first) {
            Some(i) if i < part.vertices.len() as u32 => (self.vertices.len() as u32 + i, plan.parents[i as usize]),
            Some(_) => return Err("the vertex has not arrived"),
            None if self.entry(m.vertex) >= self.level_start() => {
                let entry = self.entry(m.vertex);
                (entry, self.parents[entry as usize])
            }
            None => return Err("the vertex is of an earlier level"),
        };
        let triangle = self.triangles.get_mut(m.triangle as usize).ok_or("the triangle has not arrived")?;
        let corner = triangle.get_mut(m.corner as usize).ok_or("a triangle has corners 0, 1 and 2")?;
        if parent == NO_REPRESENTATIVE || *corner != parent {
            return Err("it does not hold that vertex's representative");
        }
        Ok(std::mem::replace(corner, entry))
    }

    fn apply(&mut self, part: &Level, plan: Plan, mut corners: Vec<u32>) -> Change {
        let first = self.logical_count();
        let first_entry = self.vertices.len() as u32;
        self.vertices.extend_from(&part.vertices);
        extend(&mut self.parents, &plan.parents);
        if let Some(versions) = &mut self.versions {
            (0..part.vertices.len()).for_each(|_| versions.push_vertex());
        }
        let seam = |m: &Self, v: u32| m.entry_of_new_or_old_after(v, first, first_entry);
        let seams: Vec<_> = part.position_of.iter().map(|&(v, p)| (seam(self, v), seam(self, p))).collect();
        self.seams.extend(seams);
        for i in 0..part.vertices.len() as u32 {
            if self.pending.is_empty() {
                break;
            }
            let parent = plan.parents[i as usize];
            for corner in self.pending.arrive(first + i) {
                let at = &mut self.triangles[corner as usize / 3][corner as usize % 3];
                if *at == parent {
                    *at = first_entry + i;
                    corners.push(corner);
                }
            }
        }
        extend(&mut self.triangles, &plan.triangles);
        plan.waiting.iter().for_each(|&(v, corner)| self.pending.wait(v, corner));
        self.apply_moves(part);
        Change { corners }
    }

    fn entry_of_new_or_old_after(&self, vertex: u32, first_new: u32, first_entry: u32) -> u32 {
        vertex.checked_sub(first_new).map_or_else(|| self.entry(vertex), |i| first_entry + i)
    }

    fn apply_moves(&mut self, part: &Level) {
        if part.moved.ids.is_empty() {
            return;
        }
        let count = self.vertices.len() as u32;
        let versions = self.versions.get_or_insert_with(|| Box::new(Versions::identity(count)));
        for &v in &part.moved.ids {
            self.parents.push(versions.current(v));
            versions.push_version(v);
        }
        self.vertices.extend_from(&part.moved.values);
    }
}
