//! Stanford PLY, ASCII and both binary byte orders, by ply-rs-bw: vertices, faces, and triangle strips.

use super::{Dropped, Model};
use crate::BuildError;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use pmesh_core::{IndexedMesh, Vertices};

/// Names of the vertex properties that are read, in slots.
const NAMES: [&str; 12] = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "alpha", "u", "v"];

fn slot(name: &str) -> Option<usize> {
    let name = match name {
        "s" | "texture_u" | "s0" => "u",
        "t" | "texture_v" | "t0" => "v",
        "diffuse_red" | "r" => "red",
        "diffuse_green" | "g" => "green",
        "diffuse_blue" | "b" => "blue",
        other => other,
    };
    NAMES.iter().position(|n| *n == name)
}

/// A vertex, or anything else that has scalar properties only.
struct Row([f32; 12]);

impl PropertyAccess for Row {
    fn new() -> Self {
        Row([0.0; 12])
    }
    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if let (Some(slot), Some(value)) = (slot(name), property.to_f32_lossy()) {
            self.0[slot] = value;
        }
        PropertyAccessResult::Set
    }
}

/// A face or a strip. Strips use -1, so indices are signed here.
struct Face(Vec<i64>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Face(Vec::new())
    }
    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if name == "vertex_indices" || name == "vertex_index" {
            self.0 = match property {
                Property::ListChar(l) => l.into_iter().map(i64::from).collect(),
                Property::ListUChar(l) => l.into_iter().map(i64::from).collect(),
                Property::ListShort(l) => l.into_iter().map(i64::from).collect(),
                Property::ListUShort(l) => l.into_iter().map(i64::from).collect(),
                Property::ListInt(l) => l.into_iter().map(i64::from).collect(),
                Property::ListUInt(l) => l.into_iter().map(i64::from).collect(),
                _ => Vec::new(),
            };
        }
        PropertyAccessResult::Set
    }
}

fn bad(error: ParseError, offset: usize, ascii: bool) -> BuildError {
    // The parser's message goes on with what its grammar expected.
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    let message = first.split_once(": ").map_or(first, |parts| parts.1).trim_end_matches('.').to_string();
    let line = text.lines().find_map(|l| l.trim().strip_prefix("String: "));
    let message = line.map_or(message.clone(), |l| format!("{message} {}", l.trim_matches('\'')));
    match error.line() {
        Some(line) if ascii => BuildError::Line { format: "PLY", line, message },
        _ => BuildError::Byte { format: "PLY", offset, message },
    }
}

pub(super) fn read(bytes: &[u8]) -> Result<Model, BuildError> {
    let mut reader = Reader::new(bytes);
    let offset = |reader: &Reader<&[u8]>| bytes.len() - reader.get_ref().len();
    let header = Parser::<Row>::new().read_header(&mut reader).map_err(|e| bad(e, 0, true))?;
    let ascii = header.encoding == Encoding::Ascii;
    let mut vertices = Vertices::default();
    let mut faces: Vec<Face> = Vec::new();
    let mut strips: Vec<Face> = Vec::new();
    let mut dropped = Dropped::default();
    for (name, element) in &header.elements {
        let wrap = |e: ParseError, r: &Reader<&[u8]>| bad(e, offset(r), ascii);
        // Nothing of an element without properties is in the file, whatever its count says.
        if element.properties.is_empty() {
            dropped.note(format!("{name:?} elements have no properties"));
            continue;
        }
        match name.as_str() {
            "vertex" => {
                let rows = Parser::<Row>::new().read_payload_for_element(&mut reader, element, &header);
                let rows = rows.map_err(|e| wrap(e, &reader))?;
                let has = |names: &[&str]| names.iter().all(|n| element.properties.iter().any(|(p, _)| slot(p) == slot(n)));
                for (property, _) in element.properties.iter().filter(|(p, _)| slot(p).is_none()) {
                    dropped.note(format!("the vertex property {property:?} is not carried"));
                }
                let red = element.properties.iter().find(|(p, _)| slot(p) == slot("red")).map(|(_, d)| &d.data_type);
                let color_scale = match red {
                    Some(PropertyType::Scalar(ScalarType::UChar | ScalarType::Char)) => 255.0,
                    Some(PropertyType::Scalar(ScalarType::UShort)) => 65535.0,
                    _ => 1.0,
                };
                fill(&mut vertices, &rows, has, color_scale);
            }
            "face" => {
                let read = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                faces.extend(read.map_err(|e| wrap(e, &reader))?);
                for (property, _) in element.properties.iter().filter(|(p, _)| !p.starts_with("vertex_ind")) {
                    dropped.note(format!("the face property {property:?} is not carried"));
                }
            }
            "tristrips" => {
                let read = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                strips = read.map_err(|e| wrap(e, &reader))?;
            }
            other => {
                dropped.note(format!("{other:?} elements are not carried"));
                let read = Parser::<Row>::new().read_payload_for_element(&mut reader, element, &header);
                read.map_err(|e| wrap(e, &reader))?;
            }
        }
    }
    let mut triangles = Vec::new();
    for (i, face) in faces.iter().enumerate() {
        add_face(&face.0, &vertices, &mut triangles, &mut dropped).map_err(|m| at("face", i, m))?;
    }
    for (i, strip) in strips.iter().enumerate() {
        add_strip(&strip.0, vertices.len(), &mut triangles).map_err(|m| at("strip", i, m))?;
    }
    let mesh = IndexedMesh { vertices, triangles, position_of: Vec::new() };
    Ok(Model { mesh, texture: None, warnings: dropped.into_warnings() })
}

fn at(what: &str, i: usize, message: String) -> BuildError {
    BuildError::File { format: "PLY", message: format!("{what} {i}: {message}") }
}

fn fill(out: &mut Vertices, rows: &[Row], has: impl Fn(&[&str]) -> bool, color_scale: f32) {
    let a = &mut out.attributes;
    let (normals, colors) = (has(&["nx", "ny", "nz"]), has(&["red", "green", "blue"]));
    let (alpha, texcoords) = (has(&["alpha"]), has(&["u", "v"]));
    for Row(r) in rows {
        out.positions.push([r[0], r[1], r[2]]);
        if normals {
            a.normals.push([r[3], r[4], r[5]]);
        }
        if colors {
            let opaque = if alpha { r[9] / color_scale } else { 1.0 };
            a.colors.push([r[6] / color_scale, r[7] / color_scale, r[8] / color_scale, opaque]);
        }
        if texcoords {
            a.texcoords.push([r[10], r[11]]);
        }
    }
}

fn checked(v: i64, count: usize) -> Result<u32, String> {
    match u32::try_from(v) {
        Ok(i) if (i as usize) < count => Ok(i),
        _ => Err(format!("{v} is not the index of a vertex (0 to {})", count.saturating_sub(1))),
    }
}

fn add_face(face: &[i64], vertices: &Vertices, out: &mut Vec<[u32; 3]>, dropped: &mut Dropped) -> Result<(), String> {
    let corners = face.iter().map(|&v| checked(v, vertices.len())).collect::<Result<Vec<_>, _>>()?;
    if corners.len() < 3 {
        dropped.note("faces of fewer than three corners are not carried");
    }
    let points: Vec<_> = corners.iter().map(|&v| vertices.positions[v as usize]).collect();
    pmesh_core::polygon::triangulate(&points, |t| out.push(t.map(|i| corners[i])));
    Ok(())
}

/// Strips end at -1; every second triangle runs the other way round. Triangles that only turn the strip are left out.
fn add_strip(strip: &[i64], count: usize, out: &mut Vec<[u32; 3]>) -> Result<(), String> {
    for run in strip.split(|&v| v == -1) {
        let run = run.iter().map(|&v| checked(v, count)).collect::<Result<Vec<_>, _>>()?;
        for (i, w) in run.windows(3).enumerate() {
            let t = if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            if t[0] != t[1] && t[1] != t[2] && t[2] != t[0] {
                out.push(t);
            }
        }
    }
    Ok(())
}
