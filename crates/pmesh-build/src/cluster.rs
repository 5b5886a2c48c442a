//! Levels from arbitrary vertex clusterings, several steps of them, topology-changing ones too (A.25).
//!
//! Source: GV99, Figure 12. Of each cluster one vertex, the *preferred ancestor*, keeps its identity: the one nearest to
//! the new vertex, ties to the lowest index. Where the new vertex stands elsewhere, its ancestor moves.

use crate::BuildError;
use crate::arrange::{Forest, arrange};
use pmesh_core::forest::NO_REPRESENTATIVE;
use pmesh_core::{IndexedMesh, Level, MovedVertices, Vertices};

/// One step from fine to coarse.
#[derive(Clone, Debug, Default)]
pub struct Clustering {
    /// Vertices after the step, with the attributes of the mesh.
    pub vertices: Vertices,
    /// For each vertex before the step, its vertex after it.
    pub map: Vec<u32>,
}

/// Levels of `mesh` under `steps`, finest first: one level more than steps. Coarse vertices that do not stand where their
/// preferred ancestor does move, level by level. Errors: maps that do not fit.
pub fn levels_from_clusterings(mesh: &IndexedMesh, steps: &[Clustering]) -> Result<Vec<Level>, BuildError> {
    let n = mesh.vertices.len();
    let mut forest = Forest { parents: vec![NO_REPRESENTATIVE; n], levels: vec![0; n], level_count: steps.len() as u32 + 1 };
    // Input vertex that each vertex of the present mesh is.
    let mut identity: Vec<u32> = (0..n as u32).collect();
    let mut present = mesh.vertices.clone();
    // Values of input vertices at each level, from the finest.
    let mut values = vec![mesh.vertices.clone()];
    for (i, step) in steps.iter().enumerate() {
        let ancestors = preferred_ancestors(i, step, &present)?;
        for (old, &new) in step.map.iter().enumerate() {
            let (child, parent) = (identity[old], identity[ancestors[new as usize] as usize]);
            if child == parent {
                forest.levels[child as usize] = i as u32 + 1;
            } else {
                forest.parents[child as usize] = parent;
            }
        }
        identity = ancestors.iter().map(|&a| identity[a as usize]).collect();
        present = step.vertices.clone();
        let mut at_level = values[i].clone();
        identity.iter().enumerate().for_each(|(new, &v)| overwrite(&mut at_level, v as usize, &present, new));
        values.push(at_level);
    }
    let arranged = arrange(mesh, &forest)?;
    let mut levels = arranged.levels;
    with_moves(&mut levels, &values, &arranged.vertex_order);
    Ok(levels)
}

fn preferred_ancestors(i: usize, step: &Clustering, present: &Vertices) -> Result<Vec<u32>, BuildError> {
    let wrong = |what: &str| BuildError::Option(format!("clustering {i}: {what}"));
    if step.map.len() != present.len() || step.vertices.set() != present.set() && !step.vertices.is_empty() {
        return Err(wrong("its map or attributes do not fit the vertices before it"));
    }
    let mut best: Vec<Option<(f32, u32)>> = vec![None; step.vertices.len()];
    for (old, &new) in step.map.iter().enumerate() {
        let to = step.vertices.positions.get(new as usize).ok_or_else(|| wrong("the map points past its vertices"))?;
        let from = present.positions[old];
        let d: f32 = (0..3).map(|k| (from[k] - to[k]).powi(2)).sum();
        let slot = &mut best[new as usize];
        if slot.is_none_or(|(least, _)| d < least) {
            *slot = Some((d, old as u32));
        }
    }
    best.into_iter().map(|b| b.map(|(_, old)| old).ok_or_else(|| wrong("a new vertex has no vertex mapped to it"))).collect()
}

fn overwrite(to: &mut Vertices, i: usize, from: &Vertices, j: usize) {
    to.positions[i] = from.positions[j];
    fn copy<const N: usize>(to: &mut [[f32; N]], i: usize, from: &[[f32; N]], j: usize) {
        if let (Some(to), Some(from)) = (to.get_mut(i), from.get(j)) {
            *to = *from;
        }
    }
    copy(&mut to.attributes.normals, i, &from.attributes.normals, j);
    copy(&mut to.attributes.colors, i, &from.attributes.colors, j);
    copy(&mut to.attributes.texcoords, i, &from.attributes.texcoords, j);
}

/// Puts the values that vertices have at each level into `levels` (coarsest first), `values` being those of the input's
/// vertices from the finest level on, `new` their new indices: new vertices start at their value, others move (D.9).
pub fn with_moves(levels: &mut [Level], values: &[Vertices], new: &[u32]) {
    let mut old = vec![0u32; new.len()];
    new.iter().enumerate().for_each(|(o, &n)| old[n as usize] = o as u32);
    let mut first = 0usize;
    let count = levels.len();
    for (step, level) in levels.iter_mut().enumerate() {
        let now = &values[count - 1 - step];
        let end = first + level.vertices.len();
        level.vertices = now.select(old[first..end].iter().copied());
        let Some(before) = (step > 0).then(|| &values[count - step]) else {
            first = end;
            continue;
        };
        let moved = (0..first as u32).filter(|&v| {
            let o = old[v as usize] as usize;
            !now.same(o, before, o)
        });
        let ids: Vec<u32> = moved.collect();
        let values = now.select(ids.iter().map(|&v| old[v as usize]));
        level.moved = MovedVertices { ids, values };
        first = end;
    }
    // Seams hold while positions agree; where a level breaks one, drop it.
    drop_broken_seams(levels);
}

fn drop_broken_seams(levels: &mut [Level]) {
    let mut all: Vec<[f32; 3]> = Vec::new();
    for level in levels {
        all.extend_from_slice(&level.vertices.positions);
        level.position_of.retain(|&(v, p)| all[v as usize] == all[p as usize]);
        for (&v, p) in level.moved.ids.iter().zip(&level.moved.values.positions) {
            all[v as usize] = *p;
        }
    }
}
