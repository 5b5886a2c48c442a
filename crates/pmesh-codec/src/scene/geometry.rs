//! Nodes of a scene to arrays: plain face sets with their transforms, merged into one mesh.

use super::tree::{Node, Value};
use pmesh_core::normals::smooth_normals;
use pmesh_core::polygon::triangulate;
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;

/// A column-major 3 × 4 matrix: axes, then origin.
pub(super) type Matrix = [[f64; 3]; 4];

pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]];

fn apply(m: &Matrix, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| m[0][k] * p[0] + m[1][k] * p[1] + m[2][k] * p[2] + m[3][k])
}
fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let origin = apply(a, b[3]);
    let axis = |i: usize| std::array::from_fn(|k| a[0][k] * b[i][0] + a[1][k] * b[i][1] + a[2][k] * b[i][2]);
    [axis(0), axis(1), axis(2), origin]
}

fn vector(node: &Node, field: &str, default: [f64; 3]) -> [f64; 3] {
    let n = node.numbers(field);
    if n.len() == 3 { [n[0], n[1], n[2]] } else { default }
}

fn rotation(axis_angle: &[f64]) -> Matrix {
    let &[x, y, z, angle] = axis_angle else { return IDENTITY };
    let length = (x * x + y * y + z * z).sqrt();
    if length == 0.0 {
        return IDENTITY;
    }
    let (x, y, z) = (x / length, y / length, z / length);
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y + s * z, t * x * z - s * y],
        [t * x * y - s * z, t * y * y + c, t * y * z + s * x],
        [t * x * z + s * y, t * y * z - s * x, t * z * z + c],
        [0.0; 3],
    ]
}

fn translation(t: [f64; 3]) -> Matrix {
    let [x, y, z, _] = IDENTITY;
    [x, y, z, t]
}

/// T C R SR S -SR -C, as VRML97 6.52 has it.
fn transform(node: &Node) -> Matrix {
    let center = vector(node, "center", [0.0; 3]);
    let scale = vector(node, "scale", [1.0; 3]);
    let turned = node.numbers("scaleOrientation");
    let back: Vec<f64> = turned.iter().enumerate().map(|(i, &x)| if i == 3 { -x } else { x }).collect();
    let scaled: Matrix = [[scale[0], 0.0, 0.0], [0.0, scale[1], 0.0], [0.0, 0.0, scale[2]], [0.0; 3]];
    [
        translation(center),
        rotation(&node.numbers("rotation")),
        rotation(&turned),
        scaled,
        rotation(&back),
        translation(center.map(|x| -x)),
    ]
    .iter()
    .fold(translation(vector(node, "translation", [0.0; 3])), |m, next| times(&m, next))
}

/// What a Material shows where it does not say.
const DEFAULT_DIFFUSE: [f32; 3] = [0.8; 3];

/// A geometry, where it stands, and the colour of its material.
#[derive(Clone, Copy)]
pub(super) struct Shape<'a> {
    pub(super) node: &'a Node,
    at: Matrix,
    color: Option<[f32; 4]>,
}

/// Geometry nodes with where they stand, in order, and what cannot be carried.
pub(super) fn shapes<'a>(nodes: &'a [Node], protos: &[String], warnings: &mut Vec<String>) -> Vec<Shape<'a>> {
    let mut out = Vec::new();
    let mut waiting: Vec<Shape> = nodes.iter().rev().map(|node| Shape { node, at: IDENTITY, color: None }).collect();
    while let Some(Shape { node, at, color }) = waiting.pop() {
        let below =
            |field: &'static str, at: Matrix| node.nodes(field).map(move |node| Shape { node, at, color }).collect::<Vec<_>>();
        let children = match node.name.as_str() {
            "Transform" => below("children", times(&at, &transform(node))),
            "Group" | "StaticGroup" | "Anchor" | "Collision" | "Billboard" | "Scene" | "X3D" => below("children", at),
            // The first is the finest.
            "LOD" => [below("level", at), below("children", at)].concat().into_iter().take(1).collect(),
            "Switch" => {
                let which = node.numbers("whichChoice").first().copied().unwrap_or(-1.0);
                let all = [below("choice", at), below("children", at)].concat();
                if which >= 0.0 { all.into_iter().skip(which as usize).take(1).collect() } else { Vec::new() }
            }
            "Shape" => {
                let material = node.nodes("appearance").flat_map(|a| a.nodes("material")).next();
                let color = material.filter(|m| m.name == "Material").and_then(diffuse);
                below("geometry", at).into_iter().map(|s| Shape { color, ..s }).collect()
            }
            "IndexedFaceSet" | "IndexedTriangleSet" | "ProgIndexedTriSet" | "MultiLevelProgIfs" => {
                out.push(Shape { node, at, color });
                Vec::new()
            }
            "Inline" => {
                warnings.push(format!("line {}: Inline is not followed: {:?}", node.line, node.texts("url")));
                Vec::new()
            }
            "Box"
            | "Cone"
            | "Cylinder"
            | "Sphere"
            | "Extrusion"
            | "ElevationGrid"
            | "Text"
            | "IndexedLineSet"
            | "PointSet"
            | "TriangleSet"
            | "TriangleFanSet"
            | "TriangleStripSet"
            | "IndexedTriangleStripSet"
            | "IndexedTriangleFanSet" => {
                warnings.push(format!("line {}: the geometry {} is not carried", node.line, node.name));
                Vec::new()
            }
            name if protos.iter().any(|p| p == name) => {
                warnings.push(format!("line {}: {name} is a PROTO, and what it is made of is not shown", node.line));
                Vec::new()
            }
            // Lights, views, sensors, appearances: not geometry.
            _ => Vec::new(),
        };
        waiting.extend(children.into_iter().rev());
    }
    out
}

/// A material's colour with its transparency, if it says one.
fn diffuse(material: &Node) -> Option<[f32; 4]> {
    let own = tuples::<3>(&material.numbers("diffuseColor")).first().copied();
    let transparency = material.numbers("transparency").first().map(|&t| t as f32);
    let [r, g, b] = own.or(transparency.map(|_| DEFAULT_DIFFUSE))?;
    Some([r, g, b, 1.0 - transparency.unwrap_or(0.0)].map(|c| c.clamp(0.0, 1.0)))
}

/// The tuples of a list of numbers.
pub(super) fn tuples<const N: usize>(numbers: &[f64]) -> Vec<[f32; N]> {
    numbers.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k] as f32)).collect()
}

/// The points of a geometry's coordinates; where `flat` is given, two numbers each if only that reaches that index (as in FC01's
/// Figure 5, which omits z).
pub(super) fn points(node: &Node, flat: Option<u32>) -> Result<Vec<[f32; 3]>, String> {
    let numbers = node.nodes("coord").next().map(|c| c.only_numbers("point")).transpose()?.unwrap_or_default();
    let needed = flat.map_or(0, |h| h as usize + 1);
    if numbers.len() / 3 < needed && numbers.len() / 2 >= needed && numbers.len().is_multiple_of(2) {
        return Ok(tuples::<2>(&numbers).into_iter().map(|[x, y]| [x, y, 0.0]).collect());
    }
    if !numbers.len().is_multiple_of(3) {
        return Err(format!("{} numbers are no points of three", numbers.len()));
    }
    Ok(tuples(&numbers))
}

/// Indices of a field, -1 kept as `None`.
pub(super) fn indices(node: &Node, field: &str) -> Result<Vec<Option<u32>>, String> {
    let index = |n: f64| match n {
        n if n < 0.0 => Ok(None),
        n if n.fract() == 0.0 && n < f64::from(u32::MAX) => Ok(Some(n as u32)),
        n => Err(format!("{n} in {field} is no index")),
    };
    node.only_numbers(field)?.into_iter().map(index).collect()
}

/// Runs of indices between -1s; a last one that is not closed counts.
pub(super) fn runs(indices: &[Option<u32>]) -> Vec<Vec<u32>> {
    indices.split(Option::is_none).map(|r| r.iter().flatten().copied().collect::<Vec<_>>()).filter(|r| !r.is_empty()).collect()
}

/// Red, green, blue and perhaps alpha of a Color or ColorRGBA node.
pub(super) fn colors(node: &Node) -> Vec<[f32; 4]> {
    match node.nodes("color").next() {
        Some(c) if c.name == "ColorRGBA" => tuples(&c.numbers("color")),
        Some(c) => tuples::<3>(&c.numbers("color")).into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect(),
        None => Vec::new(),
    }
}
pub(super) fn normals(node: &Node) -> Vec<[f32; 3]> {
    node.nodes("normal").next().map(|n| tuples(&n.numbers("vector"))).unwrap_or_default()
}
pub(super) fn texcoords(node: &Node) -> Vec<[f32; 2]> {
    node.nodes("texCoord").next().map(|t| tuples(&t.numbers("point"))).unwrap_or_default()
}

/// One attribute of a face set: its values and how corners find theirs.
struct Channel<T> {
    values: Vec<T>,
    index: Vec<Option<u32>>,
    per_vertex: bool,
}

impl<T: Copy> Channel<T> {
    fn new(node: &Node, values: Vec<T>, index: &str, flag: &str) -> Result<Self, String> {
        Ok(Self { values, index: indices(node, index)?, per_vertex: flag.is_empty() || node.flag(flag, true) })
    }
    /// Number of the value at a corner: its place in coordIndex, its face, its vertex.
    fn at(&self, place: usize, face: usize, vertex: u32) -> Option<u32> {
        let wanted = match (self.per_vertex, self.index.is_empty()) {
            (true, true) => Some(vertex),
            (true, false) => self.index.get(place).copied().flatten(),
            (false, true) => Some(face as u32),
            (false, false) => self.index.get(face).copied().flatten(),
        };
        wanted.filter(|&i| (i as usize) < self.values.len())
    }
}

/// One shape's arrays; an attribute is there for all vertices or none.
fn face_set(node: &Node, at: &Matrix, warnings: &mut Vec<String>) -> Result<IndexedMesh, String> {
    let field = if node.name == "IndexedTriangleSet" { "index" } else { "coordIndex" };
    let mut flat = indices(node, field)?;
    if field == "index" {
        flat = flat.chunks(3).flat_map(|t| t.iter().copied().chain([None])).collect();
    }
    let positions = points(node, None)?;
    let color = Channel::new(node, colors(node), "colorIndex", "colorPerVertex")?;
    let normal = Channel::new(node, normals(node), "normalIndex", "normalPerVertex")?;
    let texcoord = Channel::new(node, texcoords(node), "texCoordIndex", "")?;
    let mut mesh = IndexedMesh::default();
    let mut known: HashMap<[Option<u32>; 4], u32> = HashMap::new();
    let mut first_at: Vec<Option<u32>> = vec![None; positions.len()];
    let (mut face, mut place) = (0, 0);
    let ccw = node.flag("ccw", true);
    for run in flat.split(Option::is_none) {
        let mut corners = Vec::with_capacity(run.len());
        for (i, v) in run.iter().flatten().copied().enumerate() {
            let here = place + i;
            let key = [Some(v), color.at(here, face, v), normal.at(here, face, v), texcoord.at(here, face, v)];
            let p = positions.get(v as usize).ok_or_else(|| format!("index {v} of {} points", positions.len()))?;
            let next = mesh.vertices.len() as u32;
            let vertex = *known.entry(key).or_insert(next);
            if vertex == next {
                mesh.vertices.positions.push(apply(at, p.map(f64::from)).map(|x| x as f32));
                let a = &mut mesh.vertices.attributes;
                a.colors.extend(key[1].map(|i| color.values[i as usize]));
                a.normals.extend(key[2].map(|i| normal.values[i as usize]));
                a.texcoords.extend(key[3].map(|i| texcoord.values[i as usize]));
                match first_at[v as usize] {
                    Some(first) => mesh.position_of.push((vertex, first)),
                    None => first_at[v as usize] = Some(vertex),
                }
            }
            corners.push(vertex);
        }
        place += run.len() + 1;
        face += usize::from(!run.is_empty());
        if !ccw {
            corners.reverse();
        }
        let shape: Vec<[f32; 3]> = corners.iter().map(|&v| mesh.vertices.positions[v as usize]).collect();
        triangulate(&shape, |t| mesh.triangles.push(t.map(|i| corners[i])));
    }
    // Points that no face uses are vertices too, where no attribute is missing for them.
    let n = mesh.vertices.len();
    let a = &mut mesh.vertices.attributes;
    let mut left_out =
        |what: &str| warnings.push(format!("line {}: {what} do not reach all corners and are left out", node.line));
    if !color.values.is_empty() && a.colors.len() != n {
        a.colors.clear();
        left_out("colours");
    }
    if !normal.values.is_empty() && a.normals.len() != n {
        a.normals.clear();
        left_out("normals");
    }
    if !texcoord.values.is_empty() && a.texcoords.len() != n {
        a.texcoords.clear();
        left_out("texture coordinates");
    }
    if mesh.vertices.set() == Default::default() {
        let unused = first_at.iter().zip(&positions).filter(|f| f.0.is_none());
        mesh.vertices.positions.extend(unused.map(|(_, p)| apply(at, p.map(f64::from)).map(|x| x as f32)));
    }
    // Normals turn with their shape, and by the inverse of its scale; unequal scales are rare enough to compute them anew.
    if at != &IDENTITY && !mesh.vertices.attributes.normals.is_empty() {
        mesh.vertices.attributes.normals = smooth_normals(&mesh.vertices.positions, &mesh.triangles, &mesh.position_of);
    }
    Ok(mesh)
}

/// All plain shapes in one mesh; an attribute that some lack is made up for: white, computed, zero.
pub(super) fn merged(shapes: &[Shape], warnings: &mut Vec<String>) -> Result<IndexedMesh, (u64, String)> {
    let parts =
        shapes.iter().map(|s| face_set(s.node, &s.at, warnings).map_err(|e| (s.node.line, e))).collect::<Result<Vec<_>, _>>()?;
    let has = |f: fn(&Vertices) -> bool| parts.iter().any(|p| f(&p.vertices));
    let wanted = (
        has(|v| v.set().colors) || shapes.iter().any(|s| s.color.is_some()),
        has(|v| v.set().normals),
        has(|v| v.set().texcoords),
    );
    let mut out = IndexedMesh::default();
    for (mut part, shape) in parts.into_iter().zip(shapes) {
        let n = part.vertices.len();
        let a = &mut part.vertices.attributes;
        if wanted.0 {
            a.colors.resize(n, shape.color.unwrap_or([1.0; 4]));
        }
        if wanted.1 && a.normals.is_empty() {
            a.normals = smooth_normals(&part.vertices.positions, &part.triangles, &part.position_of);
        }
        if wanted.2 {
            a.texcoords.resize(n, [0.0; 2]);
        }
        let first = out.vertices.len() as u32;
        out.vertices.extend_from(&part.vertices);
        out.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
        out.position_of.extend(part.position_of.iter().map(|&(v, p)| (v + first, p + first)));
    }
    Ok(out)
}

/// The URL that a node names, if it names one.
pub(super) fn url(node: &Node) -> Option<String> {
    node.values("urlData").iter().find_map(|v| match v {
        Value::Text(t) if !t.is_empty() => Some(t.clone()),
        Value::Word(w) if w != "NULL" => Some(w.clone()),
        _ => None,
    })
}
