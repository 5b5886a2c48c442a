//! A mesh to a vertex hierarchy: half-edge collapses in independent sets (E.15), with the fundamental cut vertices of each (E.3) and bounds of what
//! lies below (E.10).

use crate::vector::{Point, add, cross, dot, from_triangle, length, sub};
use pmesh_codec::compact::CompactStream;
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::{Bounds, HierarchyError, NONE, VertexHierarchy};

/// Most vertices below a node whose distances are looked at; of more, some.
const LOOKS: usize = 64;
/// Most vertices below a node whose own cones are looked at; of more, those of the children.
const CONES: usize = 512;

/// The hierarchy of what `stream` takes apart. Positions are those of `mesh`, which is the stream's or that on its grid. O(n log n). Errors: a stream that does not fit the mesh.
pub fn hierarchy(mesh: &IndexedMesh, stream: &CompactStream) -> Result<VertexHierarchy, HierarchyError> {
    let (low, high) = mesh.bounds();
    let diagonal = (0..3).map(|k| f64::from(high[k]) - f64::from(low[k])).map(|x| x * x).sum::<f64>().sqrt();
    // No ball about a vertex need be larger.
    let unit = if diagonal > 0.0 { 2.0 * diagonal } else { 1.0 };
    let mut replay = Replay::new(mesh, unit);
    let mut collapses = Vec::with_capacity(stream.levels.iter().map(Vec::len).sum());
    let mut bounds = Vec::with_capacity(collapses.capacity());
    let mut is_gone = vec![false; mesh.vertices.len()];
    for r in stream.levels.iter().rev().flatten() {
        // What is below a vertex is a list, which must not meet itself.
        let gone = |v: u32| is_gone.get(v as usize).is_none_or(|&g| g);
        if gone(r.vertex) || gone(r.apex) || r.vertex == r.apex {
            return Err(HierarchyError::BadVertex { collapse: collapses.len() as u32, vertex: r.vertex });
        }
        is_gone[r.vertex as usize] = true;
        let cuts = replay.collapse(r.vertex, r.apex);
        collapses.push((r.vertex, r.apex, cuts));
        bounds.push(replay.bounds(r.apex));
    }
    let mut hierarchy = VertexHierarchy::new(mesh.vertices.positions.clone(), &collapses, &stream.base_triangles)?;
    // Nodes with children have the bounds of their collapse, the last one first.
    let mut of_node = vec![Bounds::default(); hierarchy.nodes().len()];
    for (i, node) in hierarchy.nodes().iter().enumerate().filter(|(_, n)| n.child != NONE) {
        let number = (node.child - hierarchy.root_count()) as usize / 2;
        of_node[i] = bounds[bounds.len() - 1 - number];
    }
    hierarchy.set_bounds(unit, |i| of_node[i as usize])?;
    Ok(hierarchy)
}

/// A cone of normals: cosine and sine of its half angle; more than a right angle is none.
#[derive(Clone, Copy)]
struct Cone {
    axis: Point,
    angle: Option<(f64, f64)>,
}

struct Replay<'a> {
    mesh: &'a IndexedMesh,
    unit: f64,
    triangles: Vec<[u32; 3]>,
    /// Triangles that may be about each vertex.
    about: Vec<Vec<u32>>,
    /// What lies below each vertex: the next in its list, and the last.
    next: Vec<u32>,
    last: Vec<u32>,
    count: Vec<u32>,
    /// Sum of the normals × area of the triangles at what lies below.
    normals: Vec<Point>,
    cones: Vec<Cone>,
    /// Of the vertices alone, in the finest mesh.
    own_cones: Vec<Cone>,
    /// Corners of the box about all triangles at what lies below, as they were and are.
    boxes: Vec<[Point; 2]>,
    /// Along the surface, along the axis, whichever way.
    errors: Vec<[f64; 3]>,
}

impl<'a> Replay<'a> {
    fn new(mesh: &'a IndexedMesh, unit: f64) -> Self {
        let n = mesh.vertices.len();
        let mut replay = Self {
            mesh,
            unit,
            triangles: mesh.triangles.clone(),
            about: vec![Vec::new(); n],
            next: vec![NONE; n],
            last: (0..n as u32).collect(),
            count: vec![1; n],
            normals: vec![[0.0; 3]; n],
            cones: vec![Cone { axis: [0.0, 0.0, 1.0], angle: None }; n],
            own_cones: Vec::new(),
            boxes: mesh.vertices.positions.iter().map(|p| [p.map(f64::from); 2]).collect(),
            errors: vec![[0.0; 3]; n],
        };
        for (t, &v) in mesh.triangles.iter().enumerate().filter(|(_, [a, b, c])| a != b && b != c && c != a) {
            let normal = replay.normal(v);
            for k in 0..3 {
                let i = v[k] as usize;
                replay.about[i].push(t as u32);
                replay.normals[i] = add(replay.normals[i], normal);
                v.iter().for_each(|&w| replay.boxes[i] = joined(replay.boxes[i], [replay.at(w); 2]));
            }
        }
        for v in 0..n as u32 {
            replay.cones[v as usize] = replay.cone(v, &[]);
        }
        replay.own_cones = replay.cones.clone();
        replay
    }
    fn at(&self, v: u32) -> Point {
        self.mesh.vertices.positions[v as usize].map(f64::from)
    }
    fn normal(&self, [a, b, c]: [u32; 3]) -> Point {
        cross(sub(self.at(b), self.at(a)), sub(self.at(c), self.at(a)))
    }
    fn is_there(&self, t: u32) -> bool {
        let [a, b, c] = self.triangles[t as usize];
        a != b && b != c && c != a
    }

    /// Puts `blue` onto `red`; gives the third corners of the two triangles that vanish, in the finest mesh.
    fn collapse(&mut self, blue: u32, red: u32) -> [u32; 2] {
        let mut cuts = [NONE; 2];
        for t in std::mem::take(&mut self.about[blue as usize]) {
            if !self.is_there(t) {
                continue;
            }
            let corners = &mut self.triangles[t as usize];
            let Some(at) = corners.iter().position(|&v| v == blue) else { continue };
            let gone = (0..2).find(|k| corners[(at + 1 + k) % 3] == red);
            corners[at] = red;
            match gone {
                // (blue, red, cut), then (blue, cut, red).
                Some(k) => cuts[k] = self.mesh.triangles[t as usize][(at + 2 - k) % 3],
                None => self.about[red as usize].push(t),
            }
        }
        let mut about = std::mem::take(&mut self.about[red as usize]);
        about.retain(|&t| self.is_there(t));
        let children = [self.cones[red as usize], self.cones[blue as usize]];
        // What lies below.
        let end = self.last[red as usize];
        self.last[red as usize] = self.last[blue as usize];
        self.next[end as usize] = blue;
        self.count[red as usize] += self.count[blue as usize];
        self.normals[red as usize] = add(self.normals[red as usize], self.normals[blue as usize]);
        let mut all = joined(self.boxes[red as usize], self.boxes[blue as usize]);
        about.iter().flat_map(|&t| self.triangles[t as usize]).for_each(|v| all = joined(all, [self.at(v); 2]));
        self.boxes[red as usize] = all;
        self.about[red as usize] = about;
        self.cones[red as usize] = if self.count[red as usize] as usize > CONES {
            self.cone(red, &children)
        } else {
            let below = std::iter::successors(Some(red), |&v| Some(self.next[v as usize]).filter(|&w| w != NONE));
            let all: Vec<Cone> = below.map(|v| self.own_cones[v as usize]).collect();
            self.cone(red, &all)
        };
        self.measure(blue, red);
        cuts
    }

    /// A cone about the mean normal of what is below `v`, with those of `inner` and the triangles about it now.
    fn cone(&self, v: u32, inner: &[Cone]) -> Cone {
        let code = Bounds { axis: Bounds::axis_code(self.normals[v as usize]), ..Default::default() };
        let axis = code.direction();
        let mut angle = Some((1.0f64, 0.0f64));
        let mut widen = |other: Option<(f64, f64)>| {
            angle = match (angle, other) {
                (Some(a), Some(b)) => Some(if b.0 < a.0 { b } else { a }),
                _ => None,
            }
        };
        // The sine of what is less than a right angle.
        let of = |cosine: f64| (cosine > 0.0).then(|| (cosine, (1.0 - cosine * cosine).max(0.0).sqrt()));
        for part in inner {
            let between = of(dot(axis, part.axis).min(1.0));
            // cos (a + b) = cos a cos b − sin a sin b.
            widen(between.zip(part.angle).and_then(|(a, b)| of(a.0 * b.0 - a.1 * b.1)));
        }
        for &t in &self.about[v as usize] {
            let normal = self.normal(self.triangles[t as usize]);
            let size = length(normal);
            if size > 0.0 {
                widen(of(dot(axis, normal) / size));
            }
        }
        Cone { axis, angle }
    }

    /// How far what is below `red` is from the triangles about it now: along the surface, and along the axis.
    fn measure(&mut self, blue: u32, red: u32) {
        let axis = self.cones[red as usize].axis;
        let [a, b] = [red, blue].map(|v| self.errors[v as usize]);
        let mut most: [f64; 3] = std::array::from_fn(|k| a[k].max(b[k]));
        let every = (self.count[red as usize] as usize).div_ceil(LOOKS);
        let mut v = red;
        for i in 0.. {
            if i % every == 0 {
                let own = self.at(v);
                let near = self.about[red as usize].iter().map(|&t| {
                    let from = from_triangle(own, self.triangles[t as usize].map(|w| self.at(w)));
                    (dot(from, from), from)
                });
                let alone = sub(own, self.at(red));
                let (squared, from) = near.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((dot(alone, alone), alone));
                let up = dot(from, axis);
                let aside = length(sub(from, axis.map(|x| x * up)));
                most = [most[0].max(aside), most[1].max(up.abs()), most[2].max(squared.sqrt())];
            }
            v = self.next[v as usize];
            if v == NONE {
                break;
            }
        }
        self.errors[red as usize] = most;
    }

    fn bounds(&self, v: u32) -> Bounds {
        let [aside, up, whole] = self.errors[v as usize];
        let code = |x: f64| Bounds::length_code(x, self.unit);
        let angle = Bounds::angle_code(self.cones[v as usize].angle.map_or(1.0, |(_, sine)| sine + 1e-6));
        let (own, [low, high]) = (self.at(v), self.boxes[v as usize]);
        let farthest: Point = std::array::from_fn(|k| (own[k] - low[k]).max(high[k] - own[k]));
        // Every other length does.
        let radius = code(length(farthest)) | 1;
        // Not nothing: nothing is what a leaf has.
        if angle == Bounds::NO_CONE {
            return Bounds { radius, uniform: code(whole).max(1), angle, ..Default::default() };
        }
        let axis = Bounds::axis_code(self.normals[v as usize]);
        let directional = code(up);
        Bounds { radius, uniform: code(aside).max(Bounds::least_uniform(directional)), directional, axis, angle }
    }
}

fn joined([low, high]: [Point; 2], [l, h]: [Point; 2]) -> [Point; 2] {
    [std::array::from_fn(|k| low[k].min(l[k])), std::array::from_fn(|k| high[k].max(h[k]))]
}
