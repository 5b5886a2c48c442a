//! A mesh to its levels: collapse, cut the list where counts grow by a factor, arrange. What `pmesh encode` does.

use crate::arrange::{Forest, arrange, triangle_level};
use crate::cluster::with_moves;
use crate::import::Model;
use crate::simplify::{Collapses, Placement, SimplifyOptions, cluster_closest, simplify};
use crate::{BuildError, rule};
use pmesh_codec::pmesh::LevelStream;
use pmesh_core::forest::NO_REPRESENTATIVE;
use pmesh_core::{IndexedMesh, Vertices};

/// How fine the steps between levels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steps {
    /// Triangles grow by this factor from level to level, about.
    Growth(f64),
    /// This many levels, growing by equal factors.
    Count(u32),
    /// A level a vertex, for streams that are as smooth.
    Single,
}

/// What makes the list of collapses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Quadric edge collapse.
    #[default]
    Quadric,
    /// SS97's clustering of closest representatives, down to one vertex whatever the base.
    Closest,
}

/// Which cuts of the collapse list become levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LevelRule {
    /// The list in its order of cost: each level is the best mesh of its size.
    #[default]
    Cost,
    /// The paper's exact rule (A.7), its levels merged: collapses of one level are independent.
    Star,
}

/// How to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// Triangles of the coarsest level, about; 0 leaves a vertex a component.
    pub base_triangles: usize,
    /// What makes the collapses.
    pub method: Method,
    /// Half-edge collapses, or moving ones.
    pub placement: Placement,
    /// How many levels.
    pub steps: Steps,
    /// Which cuts.
    pub rule: LevelRule,
}

impl Default for BuildOptions {
    fn default() -> Self {
        let (method, placement, rule) = Default::default();
        Self { base_triangles: 60, method, placement, steps: Steps::Growth(1.5), rule }
    }
}

/// Most levels that a `.pmesh` table holds, with room for a texture.
const LEVEL_LIMIT: usize = 63;

/// Builds the levels of `model`. `progress` gets the part done, 0 to 1. O(n log n).
pub fn build(model: &Model, options: &BuildOptions, mut progress: impl FnMut(f64)) -> Result<LevelStream, BuildError> {
    let mesh = &model.mesh;
    if mesh.vertices.is_empty() {
        return Err(BuildError::Empty);
    }
    match options.steps {
        Steps::Growth(f) if !(f > 1.0 && f.is_finite()) => {
            return Err(BuildError::Option(format!("a growth factor of {f}: it must be above 1, such as 1.5")));
        }
        Steps::Count(n) if n == 0 || n as usize > LEVEL_LIMIT => {
            return Err(BuildError::Option(format!("{n} levels: 1 to {LEVEL_LIMIT} can be made")));
        }
        _ => {}
    }
    let (total, target) = (mesh.triangles.len(), options.base_triangles);
    let done = |left: usize| (total - left) as f64 / (total - target.min(total)).max(1) as f64;
    let simplify_options = SimplifyOptions { target_triangles: target, placement: options.placement };
    let collapses = match options.method {
        Method::Quadric => simplify(mesh, simplify_options, |left| progress(0.8 * done(left)))?,
        Method::Closest => {
            if (options.placement, options.rule) != Default::default() {
                return Err(BuildError::Option(
                    "closest representatives stay where they are, and their order is the levels'".into(),
                ));
            }
            let mut list = cluster_closest(mesh, |left| progress(0.8 * (1.0 - left as f64 / mesh.vertices.len() as f64)));
            if options.steps != Steps::Single {
                list.truncate(target);
            }
            list
        }
    };
    progress(0.8);
    let cuts = cuts(&collapses, total, options.steps);
    let (forest, errors) = match options.rule {
        LevelRule::Cost => by_cost(mesh, &collapses, &cuts),
        LevelRule::Star => by_star(mesh, &collapses, cuts.len())?,
    };
    let arranged = arrange(mesh, &forest)?;
    let mut levels = arranged.levels;
    if options.placement == Placement::Optimal {
        if options.rule == LevelRule::Star {
            return Err(BuildError::Option("the star rule needs vertices that stay: use it with half-edge collapses".into()));
        }
        with_moves(&mut levels, &values_at_levels(mesh, &collapses, &cuts), &arranged.vertex_order);
    }
    progress(1.0);
    Ok(LevelStream { attribute_set: mesh.vertices.set(), levels, errors, texture: model.texture.clone() })
}

/// Step counts at which levels lie, from 0 (finest) to all (coarsest).
fn cuts(collapses: &Collapses, total_triangles: usize, steps: Steps) -> Vec<usize> {
    let all = collapses.steps.len();
    let base = collapses.steps.last().map_or(total_triangles, |s| s.triangle_count as usize).max(1);
    let ratio = total_triangles.max(1) as f64 / base as f64;
    let growth = match steps {
        Steps::Growth(f) => f.max(ratio.powf(1.0 / (LEVEL_LIMIT as f64 - 2.0))),
        Steps::Count(1) => return vec![0],
        Steps::Single => return (0..=all).collect(),
        Steps::Count(n) => ratio.powf(1.0 / f64::from(n - 1)).max(1.0 + 1e-9),
    };
    let mut cuts = vec![0];
    let wanted = match steps {
        Steps::Count(n) => n as usize,
        Steps::Growth(_) | Steps::Single => LEVEL_LIMIT,
    };
    let mut size = total_triangles as f64;
    while cuts.len() + 1 < wanted {
        size /= growth;
        let cut = collapses.steps.partition_point(|s| f64::from(s.triangle_count) > size);
        if cut >= all || size <= base as f64 * growth.sqrt() && matches!(steps, Steps::Growth(_)) {
            break;
        }
        if cut > cuts[cuts.len() - 1] {
            cuts.push(cut);
        }
    }
    if all > cuts[cuts.len() - 1] {
        cuts.push(all);
    }
    cuts
}

fn by_cost(mesh: &IndexedMesh, collapses: &Collapses, cuts: &[usize]) -> (Forest, Vec<f32>) {
    let n = mesh.vertices.len();
    let top = cuts.len() as u32 - 1;
    let mut forest = Forest { parents: vec![NO_REPRESENTATIVE; n], levels: vec![top; n], level_count: top + 1 };
    let mut has_child = vec![0u32; n];
    let mut first_pair = 0;
    for (i, step) in collapses.steps.iter().enumerate() {
        let level = cuts.partition_point(|&c| c <= i) as u32 - 1;
        for &(blue, red) in &collapses.pairs[first_pair..step.pairs_end as usize] {
            forest.parents[blue as usize] = red;
            forest.levels[blue as usize] = level;
            has_child[red as usize] = has_child[red as usize].max(level + 1);
        }
        first_pair = step.pairs_end as usize;
    }
    // A root is there from the level of the first triangle or child that needs it: a component that has vanished, or a
    // vertex that nothing uses, would only be a point that is sent early.
    let mut needed = has_child;
    for t in &mesh.triangles {
        let (level, corners) = triangle_level(&forest, *t);
        corners.iter().for_each(|&v| needed[v as usize] = needed[v as usize].max(level));
    }
    for v in 0..n {
        if forest.parents[v] == NO_REPRESENTATIVE {
            forest.levels[v] = needed[v].min(top);
        }
    }
    forest.lift_parents();
    let error = |cut: &usize| cut.checked_sub(1).map_or(0.0, |last| collapses.steps[last].error);
    (forest, cuts.iter().rev().map(error).collect())
}

fn by_star(mesh: &IndexedMesh, collapses: &Collapses, count: usize) -> Result<(Forest, Vec<f32>), BuildError> {
    // The rule speaks of positions: all wedges of one share its level, or a seam would open.
    let mut position: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    mesh.position_of.iter().for_each(|&(v, p)| position[v as usize] = position[p as usize]);
    let at_position = |v: u32| position[v as usize];
    let mut positions = mesh.clone();
    positions.triangles.iter_mut().for_each(|t| *t = t.map(at_position));
    let first_pairs = std::iter::once(0).chain(collapses.steps.iter().map(|s| s.pairs_end as usize));
    let pairs: Vec<_> = first_pairs.zip(&collapses.steps).map(|(first, _)| collapses.pairs[first]).collect();
    let pairs: Vec<_> = pairs.into_iter().map(|(blue, red)| (at_position(blue), at_position(red))).collect();
    let replay = rule::replay(&positions, &pairs)?;
    // Vertices that each of the paper's levels keeps, and merged levels of about equal growth.
    let mut at_level = vec![0usize; replay.top as usize + 1];
    replay.vertex_levels.iter().for_each(|&l| at_level[l as usize] += 1);
    let n = mesh.vertices.len() as f64;
    let growth = (n / at_level[replay.top as usize].max(1) as f64).powf(1.0 / (count as f64 - 1.0).max(1.0));
    let (mut last, mut gone, mut size) = (Vec::new(), 0.0, n);
    for level in 1..replay.top {
        gone += at_level[level as usize] as f64;
        if n - gone <= size / growth && last.len() + 1 < count {
            last.push(level);
            size = n - gone;
        }
    }
    let mut forest = replay.merged(&last);
    forest.levels = position.iter().map(|&p| forest.levels[p as usize]).collect();
    collapses.pairs.iter().for_each(|&(blue, red)| forest.parents[blue as usize] = red);
    forest.lift_parents();
    let mut errors = vec![0.0f32; forest.level_count as usize];
    let mut first_pair = 0;
    for step in &collapses.steps {
        for &(blue, _) in &collapses.pairs[first_pair..step.pairs_end as usize] {
            // A collapse within the coarsest level is never done.
            if let Some(error) = errors.get_mut(forest.levels[blue as usize] as usize + 1) {
                *error = error.max(step.error);
            }
        }
        first_pair = step.pairs_end as usize;
    }
    for i in 1..errors.len() {
        errors[i] = errors[i].max(errors[i - 1]);
    }
    errors.reverse();
    Ok((forest, errors))
}

/// What the vertices of `mesh` are at each level, finest first: collapses undone from the coarsest (D.9).
fn values_at_levels(mesh: &IndexedMesh, collapses: &Collapses, cuts: &[usize]) -> Vec<Vertices> {
    let mut members: std::collections::HashMap<u32, Vec<u32>> = Default::default();
    for &(v, p) in &mesh.position_of {
        members.entry(p).or_default().push(v);
    }
    let mut now = mesh.vertices.clone();
    now.positions.clone_from(&collapses.positions);
    let mut values = vec![now.clone()];
    for pair in cuts.windows(2).rev() {
        for step in collapses.steps[pair[0]..pair[1]].iter().rev() {
            now.positions[step.red as usize] = step.red_before;
            for &v in members.get(&step.red).into_iter().flatten() {
                now.positions[v as usize] = step.red_before;
            }
        }
        values.push(now.clone());
    }
    values.reverse();
    // A vertex that is gone keeps what it last was; where it comes back its own place counts, which undoing has restored.
    values[0] = mesh.vertices.clone();
    values
}
