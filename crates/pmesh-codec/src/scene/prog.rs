//! `ProgIndexedTriSet` and `ProgLOD`: levels of patches as lists of triangles and corrections (C.7–C.12).

use super::geometry::{colors, indices, normals, points, runs, texcoords};
use super::tree::Node;
use pmesh_core::surface::{CanonicalOrder, Fan, Surface};
use pmesh_core::{Attributes, CornerMove, Level, Vertices};
use std::collections::HashMap;

/// The levels of a node, coarsest first; what is odd; and what ends them early.
pub(super) struct Levels {
    pub(super) levels: Vec<Level>,
    pub(super) warnings: Vec<String>,
    pub(super) error: Option<(u64, String)>,
    /// Triangles of the base were turned over, so that patches come out.
    pub(super) turned: bool,
}

/// The mean of a patch's rim: where FC01's decoder expects its vertex (C.4). In `f64`, so that a correction gives back
/// every `f32` exactly.
pub(super) fn mean<const N: usize>(values: &[[f32; N]], rim: &[u32]) -> [f64; N] {
    std::array::from_fn(|k| rim.iter().map(|&v| f64::from(values[v as usize][k])).sum::<f64>() / rim.len() as f64)
}
/// The rim of a fan, its apex first.
pub(super) fn rim_of(fan: &Fan) -> Vec<u32> {
    std::iter::once(fan.apex).chain(fan.chain.iter().copied()).collect()
}

/// What a vertex is put into.
enum Patch {
    Fan(Fan),
    /// Any other disk: its triangles and its boundary. They are replaced, since no representative can say what becomes of them.
    Disk(Vec<u32>, Vec<u32>),
}

/// Turns triangles so that neighbours agree, each connected piece as most of it has it (C.11). Gives how many were turned.
fn orient(triangles: &mut [[u32; 3]]) -> usize {
    let mut edges: HashMap<(u32, u32), Vec<(u32, bool)>> = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default().push((i as u32, a < b));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut count = 0;
    for seed in 0..triangles.len() {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut piece = vec![seed];
        let mut at = 0;
        while at < piece.len() {
            let i = piece[at];
            at += 1;
            let (t, own) = (triangles[i], turned[i] == Some(true));
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let Some([x, y]) = edges.get(&(a.min(b), a.max(b))).map(Vec::as_slice) else { continue };
                let (mine, other) = if x.0 == i as u32 { (x, y) } else { (y, x) };
                if turned[other.0 as usize].is_none() {
                    // Both run the same way along the edge: one of them is turned.
                    turned[other.0 as usize] = Some(own != (mine.1 == other.1));
                    piece.push(other.0 as usize);
                }
            }
        }
        let minority = piece.iter().filter(|&&i| turned[i] == Some(true)).count() * 2 > piece.len();
        for &i in &piece {
            if (turned[i] == Some(true)) != minority {
                triangles[i].swap(1, 2);
                count += 1;
            }
        }
    }
    count
}

/// Reads a node. `truncated` says that its last `ProgLOD` may be cut short and does not count; `settled` whether the base is
/// turned over, if that is known.
pub(super) fn read(node: &Node, truncated: bool, settled: Option<bool>) -> Levels {
    let attempt = |turn: bool| {
        let mut out = Levels { levels: Vec::new(), warnings: Vec::new(), error: None, turned: turn };
        out.error = levels(node, truncated, turn, &mut out).err().map(|what| (node.line, what));
        out
    };
    if let Some(turn) = settled {
        return attempt(turn);
    }
    let as_it_is = attempt(false);
    if as_it_is.error.is_none() || as_it_is.levels.is_empty() {
        return as_it_is;
    }
    // Only if patches do not come out is the base's orientation doubted.
    let turned = attempt(true);
    if turned.error.is_none() { turned } else { as_it_is }
}

fn levels(node: &Node, truncated: bool, turn: bool, out: &mut Levels) -> Result<(), String> {
    let mut triangles = Vec::new();
    let index = indices(node, "coordIndex")?;
    for run in runs(&index) {
        let [a, b, c] = run[..] else {
            return Err(format!("a face of ProgIndexedTriSet has {} corners, not 3", run.len()));
        };
        triangles.push(if node.flag("ccw", true) { [a, b, c] } else { [a, c, b] });
    }
    let highest = triangles.iter().flatten().max().copied();
    let positions = points(node, Some(highest.unwrap_or(0)))?;
    if let Some(h) = highest.filter(|&h| h as usize >= positions.len()) {
        return Err(format!("index {h} of {} points", positions.len()));
    }
    let mut all = Vertices {
        positions,
        attributes: Attributes { normals: normals(node), colors: colors(node), texcoords: texcoords(node) },
    };
    let own = ["colorIndex", "normalIndex", "texCoordIndex"].map(|f| indices(node, f));
    let separate = own.iter().any(|own| own.as_ref().is_ok_and(|own| !own.is_empty() && *own != index));
    if separate || !node.flag("colorPerVertex", true) || !node.flag("normalPerVertex", true) {
        out.warnings.push("attributes with indices of their own, or one a face, are left out of ProgIndexedTriSet".into());
        all.attributes = Attributes::default();
    }
    let n = all.len();
    let a = &mut all.attributes;
    let whole = [a.normals.len(), a.colors.len(), a.texcoords.len()].iter().all(|&l| l == 0 || l == n);
    if !whole {
        out.warnings.push("attributes that are not one a vertex are left out".into());
        all.attributes = Attributes::default();
    }
    let turned = if turn { orient(&mut triangles) } else { 0 };
    if turned > 0 {
        out.warnings
            .push(format!("{turned} of {} triangles of the base were turned over, so that neighbours agree", triangles.len()));
    }
    let count = all.len() as u32;
    out.levels.push(Level { vertices: all.clone(), triangles: triangles.clone(), ..Default::default() });
    let mut surface = Surface::new(triangles, count);
    let lods: Vec<&Node> = node.nodes("levels").collect();
    let whole = lods.len() - usize::from(truncated && !lods.is_empty());
    for (i, lod) in lods[..whole].iter().enumerate() {
        // C.10: the base's triangles by their order, later ones by the canonical order.
        let order = if i == 0 { (0..surface.triangles.len() as u32).collect() } else { CanonicalOrder::of(&surface) };
        let level = prog_lod(lod, &order, &mut surface, &mut all).map_err(|e| format!("ProgLOD {}: {e}", i + 1))?;
        out.levels.push(level);
    }
    Ok(())
}

fn prog_lod(lod: &Node, order: &[u32], surface: &mut Surface, all: &mut Vertices) -> Result<Level, String> {
    let set = all.set();
    let patches = runs(&indices(lod, "triIndex")?);
    let numbers = lod.nodes("coord").next().map(|c| c.only_numbers("point")).transpose()?.unwrap_or_default();
    let flat = numbers.len() == 2 * patches.len();
    let points: Vec<[f64; 3]> = if flat {
        numbers.chunks_exact(2).map(|c| [c[0], c[1], 0.0]).collect()
    } else {
        numbers.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
    };
    if points.len() != patches.len() {
        return Err(format!("{} patches and {} corrections", patches.len(), points.len()));
    }
    let field = |f: &str, inner: &str| lod.nodes(f).next().map(|n| n.numbers(inner)).unwrap_or_default();
    let (normal, color) = (field("normal", "vector"), field("color", "color"));
    let texcoord = field("texCoord", "point");
    let channels = color.len().checked_div(patches.len()).filter(|&c| c == 4).unwrap_or(3);
    let mut level = Level::default();
    let mut found = Vec::with_capacity(patches.len());
    let mut taken = vec![false; surface.triangles.len()];
    for (i, patch) in patches.iter().enumerate() {
        let region = patch.iter().map(|&t| order.get(t as usize).copied()).collect::<Option<Vec<_>>>();
        let region = region.ok_or_else(|| format!("patch {i} names a triangle past the {}", order.len()))?;
        if region.iter().any(|&t| std::mem::replace(&mut taken[t as usize], true)) {
            return Err(format!("patch {i} shares triangles with an earlier one"));
        }
        let disk = |rim| Some(Patch::Disk(region.clone(), rim));
        let found_one = surface.fan(&region).map(Patch::Fan).or_else(|| surface.boundary(&region).and_then(disk));
        found.push(found_one.ok_or_else(|| {
            format!(
                "the triangles {patch:?} of patch {i} make no patch: they must hang together by edges, all vertices on the rim"
            )
        })?);
    }
    for (i, patch) in found.iter().enumerate() {
        let rim = match patch {
            Patch::Fan(fan) => rim_of(fan),
            Patch::Disk(_, rim) => rim.iter().map(|&c| surface.vertex(c)).collect(),
        };
        fn corrected<const N: usize>(values: &mut Vec<[f32; N]>, rim: &[u32], correction: impl Fn(usize) -> f64) {
            let mean = mean(values, rim);
            values.push(std::array::from_fn(|k| (mean[k] + correction(k)) as f32));
        }
        let at = |list: &[f64], width: usize, k: usize| list.get(i * width + k).copied().unwrap_or(0.0);
        corrected(&mut all.positions, &rim, |k| points[i][k]);
        let a = &mut all.attributes;
        if set.normals {
            corrected(&mut a.normals, &rim, |k| at(&normal, 3, k));
        }
        if set.colors {
            corrected(&mut a.colors, &rim, |k| if k < channels { at(&color, channels, k) } else { 0.0 });
        }
        if set.texcoords {
            corrected(&mut a.texcoords, &rim, |k| at(&texcoord, 2, k));
        }
        let before = surface.triangles.len();
        let vertex = match patch {
            Patch::Fan(fan) => {
                let vertex = surface.insert(fan);
                let moves = fan.corners.iter().map(|&c| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex });
                level.corner_moves.extend(moves);
                level.representatives.push((vertex, fan.apex));
                vertex
            }
            Patch::Disk(region, corners) => {
                level.retired.extend(region);
                let nearest = nearest(&all.positions, &rim);
                level.representatives.push((all.len() as u32 - 1, nearest));
                surface.replace(region, corners)
            }
        };
        level.vertices.push_from(all, vertex as usize);
        level.triangles.extend_from_slice(&surface.triangles[before..]);
    }
    Ok(level)
}

/// Of `rim` the vertex nearest to the last of all: it stands for it at coarser levels.
fn nearest(positions: &[[f32; 3]], rim: &[u32]) -> u32 {
    let new = positions.last().copied().unwrap_or_default();
    let distance = |&&v: &&u32| (0..3).map(|k| (f64::from(positions[v as usize][k]) - f64::from(new[k])).powi(2)).sum::<f64>();
    rim.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied().unwrap_or(0)
}

/// Numbers as a node's text has them.
pub(super) fn joined(numbers: impl IntoIterator<Item = f64>, width: usize) -> String {
    let words: Vec<String> = numbers.into_iter().map(|x| x.to_string()).collect();
    words.chunks(width).map(|c| c.join(" ")).collect::<Vec<_>>().join(", ")
}
