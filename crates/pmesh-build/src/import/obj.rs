//! Wavefront OBJ: positions, normals, texture coordinates, vertex colours, polygons.
//!
//! Read here rather than by a library: those at hand drop vertices that no face uses, and give no line numbers.
//! Texture coordinates are kept as written (v upwards).

use super::scan::{Line, lines};
use super::{Dropped, Model};
use crate::BuildError;
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;

const NONE: u32 = u32::MAX;
/// Position, texture coordinate and normal of a corner; `NONE` where there is none.
type Corner = [u32; 3];

#[derive(Default)]
struct Reader {
    positions: Vec<[f32; 3]>,
    colors: Vec<[f32; 4]>,
    texcoords: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[Corner; 3]>,
    dropped: Dropped,
}

pub(super) fn read(bytes: &[u8]) -> Result<Model, BuildError> {
    let text = String::from_utf8_lossy(bytes).replace("\\\n", "  ").replace("\\\r\n", "  ");
    let mut reader = Reader::default();
    for mut line in lines("OBJ", &text) {
        reader.line(&mut line)?;
    }
    Ok(reader.into_model())
}

impl Reader {
    fn line(&mut self, line: &mut Line) -> Result<(), BuildError> {
        match line.words.next().unwrap_or("") {
            "v" => self.vertex(line)?,
            "vt" => {
                let t = line.rest()?;
                let [u, v] = [t.first().copied().unwrap_or(0.0), t.get(1).copied().unwrap_or(0.0)];
                self.texcoords.push([u, v]);
            }
            "vn" => self.normals.push(line.floats()?),
            "f" => self.face(line)?,
            "l" | "p" => self.dropped.note("lines and points are not carried"),
            "mtllib" | "usemtl" => {
                self.dropped.note("materials are not carried: only positions, normals, colours and texture coordinates are")
            }
            "g" | "o" | "s" => {}
            other => self.dropped.note(format!("{other:?} statements are not carried")),
        }
        Ok(())
    }

    fn vertex(&mut self, line: &mut Line) -> Result<(), BuildError> {
        self.positions.push(line.floats()?);
        let rest = line.rest()?;
        let color = match rest[..] {
            [r, g, b] | [_, r, g, b] => [r, g, b, 1.0],
            [r, g, b, a, ..] => [r, g, b, a],
            _ => return Ok(()),
        };
        self.colors.resize(self.positions.len() - 1, [1.0; 4]);
        self.colors.push(color);
        Ok(())
    }

    fn corner(&self, line: &Line, word: &str) -> Result<Corner, BuildError> {
        let counts = [self.positions.len(), self.texcoords.len(), self.normals.len()];
        let mut corner = [NONE; 3];
        for (k, part) in word.split('/').enumerate().take(3).filter(|(_, p)| !p.is_empty()) {
            let index: i64 = part.parse().map_err(|_| line.error(format!("{word:?} is not a corner")))?;
            // From 1 upwards, or from -1 downwards.
            let i = if index < 0 { counts[k] as i64 + index } else { index - 1 };
            if index == 0 || !(0..counts[k] as i64).contains(&i) {
                return Err(line.error(format!("{word:?} refers past the {} that are there", counts[k])));
            }
            corner[k] = i as u32;
        }
        if corner[0] == NONE { Err(line.error(format!("{word:?} names no position"))) } else { Ok(corner) }
    }

    fn face(&mut self, line: &mut Line) -> Result<(), BuildError> {
        let words: Vec<_> = line.words.by_ref().collect();
        let corners = words.iter().map(|w| self.corner(line, w)).collect::<Result<Vec<_>, _>>()?;
        if corners.len() < 3 {
            self.dropped.note("faces of fewer than three corners are not carried");
        }
        let points: Vec<_> = corners.iter().map(|c| self.positions[c[0] as usize]).collect();
        pmesh_core::polygon::triangulate(&points, |t| self.triangles.push(t.map(|i| corners[i])));
        Ok(())
    }

    /// Each position becomes a vertex with the attributes of its first corner; other attributes make wedges behind them.
    fn into_model(mut self) -> Model {
        let used = |k: usize| self.triangles.iter().flatten().any(|c| c[k] != NONE);
        let (has_texcoords, has_normals) = (used(1), used(2));
        let lacking = |k: usize| self.triangles.iter().flatten().any(|c| c[k] == NONE);
        if has_texcoords && lacking(1) || has_normals && lacking(2) {
            self.dropped.note("some corners lack the attributes that others have: zeros stand in");
        }
        let mut first: Vec<Corner> = vec![[NONE; 3]; self.positions.len()];
        let mut wedges: HashMap<Corner, u32> = HashMap::new();
        let mut extra: Vec<Corner> = Vec::new();
        let count = self.positions.len() as u32;
        let mut vertex = |corner: Corner| {
            let slot = &mut first[corner[0] as usize];
            if slot[0] == NONE {
                *slot = corner;
            }
            if *slot == corner {
                return corner[0];
            }
            *wedges.entry(corner).or_insert_with(|| {
                extra.push(corner);
                count + extra.len() as u32 - 1
            })
        };
        let triangles = self.triangles.iter().map(|t| t.map(&mut vertex)).collect();
        let own = first.iter().enumerate().map(|(i, c)| if c[0] == NONE { [i as u32, NONE, NONE] } else { *c });
        let mut vertices = Vertices::default();
        for [p, t, n] in own.chain(extra.iter().copied()) {
            vertices.positions.push(self.positions[p as usize]);
            if !self.colors.is_empty() {
                vertices.attributes.colors.push(self.colors.get(p as usize).copied().unwrap_or([1.0; 4]));
            }
            if has_texcoords {
                vertices.attributes.texcoords.push(self.texcoords.get(t as usize).copied().unwrap_or([0.0; 2]));
            }
            if has_normals {
                vertices.attributes.normals.push(self.normals.get(n as usize).copied().unwrap_or([0.0, 0.0, 1.0]));
            }
        }
        let mesh = IndexedMesh { vertices, triangles, position_of: Vec::new() };
        Model { mesh, texture: None, warnings: self.dropped.into_warnings() }
    }
}
