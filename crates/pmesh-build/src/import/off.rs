//! OFF: `OFF`, `COFF`, `NOFF`, `STOFF` and their mixtures, ASCII. No library at hand reads the variants.

use super::scan::{Line, lines};
use super::{Dropped, Model};
use crate::BuildError;
use pmesh_core::{IndexedMesh, Vertices};

pub(super) fn read(bytes: &[u8]) -> Result<Model, BuildError> {
    let text = String::from_utf8_lossy(bytes);
    let file = |message: &str| BuildError::File { format: "OFF", message: message.into() };
    let mut all = lines("OFF", &text);
    let mut first = all.next().ok_or_else(|| file("the file is empty"))?;
    let mut kind = "OFF".to_string();
    if first.words.clone().next().is_some_and(|w| w.ends_with("OFF")) {
        kind = first.words.next().unwrap_or_default().to_string();
        if first.words.clone().next() == Some("BINARY") {
            return Err(first.error("binary OFF is not read: save it as ASCII OFF or as PLY"));
        }
        if kind.contains('4') || kind.contains('n') {
            return Err(first.error(format!("{kind} has vertices of other than three dimensions")));
        }
        if first.words.clone().next().is_none() {
            first = all.next().ok_or_else(|| file("the counts are missing"))?;
        }
    }
    let [vertex_count, face_count] = [first.count()?, first.count()?];
    let mut dropped = Dropped::default();
    let mut vertices = Vertices::default();
    for i in 0..vertex_count {
        let mut line = all.next().ok_or_else(|| file(&format!("the file ends after {i} of {vertex_count} vertices")))?;
        vertex(&mut line, &kind, &mut vertices, &mut dropped)?;
    }
    let mut triangles = Vec::new();
    for i in 0..face_count {
        let mut line = all.next().ok_or_else(|| file(&format!("the file ends after {i} of {face_count} faces")))?;
        face(&mut line, &vertices, &mut triangles, &mut dropped)?;
    }
    let n = vertices.len();
    let a = &mut vertices.attributes;
    if !a.colors.is_empty() && a.colors.len() != n {
        a.colors.clear();
        dropped.note("only some vertices have colours: they are not carried");
    }
    Ok(Model {
        mesh: IndexedMesh { vertices, triangles, position_of: Vec::new() },
        texture: None,
        warnings: dropped.into_warnings(),
    })
}

fn vertex(line: &mut Line, kind: &str, out: &mut Vertices, dropped: &mut Dropped) -> Result<(), BuildError> {
    out.positions.push(line.floats()?);
    if kind.contains('N') {
        out.attributes.normals.push(line.floats()?);
    }
    let mut words: Vec<&str> = line.words.by_ref().collect();
    if kind.contains("ST") && words.len() >= 2 {
        let tail = words.split_off(words.len() - 2);
        out.attributes.texcoords.push([line.parse_float(tail[0])?, line.parse_float(tail[1])?]);
    }
    if words.is_empty() {
        return Ok(());
    }
    if words.len() < 3 {
        dropped.note("a number behind a vertex means nothing here: it is not carried");
        return Ok(());
    }
    // Whole numbers count to 255, others to 1.
    let whole = words.iter().all(|w| !w.contains(['.', 'e', 'E']));
    let scale = if whole { 255.0 } else { 1.0 };
    let mut color = [0.0, 0.0, 0.0, 1.0];
    for (slot, word) in color.iter_mut().zip(&words) {
        *slot = line.parse_float(word)? / scale;
    }
    out.attributes.colors.push(color);
    Ok(())
}

fn face(line: &mut Line, vertices: &Vertices, out: &mut Vec<[u32; 3]>, dropped: &mut Dropped) -> Result<(), BuildError> {
    let count = line.float()? as usize;
    let left = line.words.clone().count();
    if count > left {
        return Err(line.error(format!("a face of {count} corners has {left} numbers")));
    }
    let corners = (0..count).map(|_| line.index(vertices.len())).collect::<Result<Vec<_>, _>>()?;
    if left > count {
        dropped.note("colours of faces are not carried");
    }
    if count < 3 {
        dropped.note("faces of fewer than three corners are not carried");
    }
    let points: Vec<_> = corners.iter().map(|&v| vertices.positions[v as usize]).collect();
    pmesh_core::polygon::triangulate(&points, |t| out.push(t.map(|i| corners[i])));
    Ok(())
}
