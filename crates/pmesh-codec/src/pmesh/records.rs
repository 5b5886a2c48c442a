//! How a level's refinements are packed in version 0: a record a new vertex, everything a difference to what is known.
//!
//! Which corners move to a new vertex is one bit for each corner that holds its representative now, in ascending corner
//! order, as SS97's update lists have it (B.13): both sides know the candidates, so their number is not sent. That needs,
//! for each vertex, the corners that hold it: [`Corners`].

use super::varint::{ReadError, Reader, put, zigzag};
use crate::corners::Corners;
use pmesh_core::CornerMove;

/// Most corners of one vertex that a record may speak of, and most triangles in it.
const RECORD_LIMIT: u32 = 1 << 24;

/// One new vertex and all that comes with it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Refinement {
    pub(super) representative: Option<u32>,
    /// Earlier vertex at the same position.
    pub(super) position_of: Option<u32>,
    pub(super) row: Vec<i32>,
    pub(super) corner_moves: Vec<CornerMove>,
    /// Triangles whose highest vertex this is, turned so that it leads.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// State that writer and reader keep alike.
pub(super) struct Model {
    channel_count: usize,
    has_seams: bool,
    rows: Vec<i32>,
    corners: Corners,
    last_representative: u32,
    candidates: Vec<u32>,
}

impl Model {
    pub(super) fn new(channel_count: usize, has_seams: bool) -> Self {
        Self {
            channel_count,
            has_seams,
            rows: Vec::new(),
            corners: Corners::default(),
            last_representative: 0,
            candidates: Vec::new(),
        }
    }
    pub(super) fn vertex_count(&self) -> u32 {
        (self.rows.len() / self.channel_count) as u32
    }
    pub(super) fn begin_level(&mut self) {
        self.last_representative = 0;
        self.corners.begin_level();
    }
    pub(super) fn row(&self, v: u32) -> &[i32] {
        let c = self.channel_count;
        &self.rows[v as usize * c..][..c]
    }
    /// What a new row is coded against: its representative's, else the newest vertex's.
    fn predicted(&self, representative: Option<u32>, k: usize) -> i32 {
        match representative.or(self.vertex_count().checked_sub(1)) {
            Some(v) => self.row(v)[k],
            None => 0,
        }
    }

    pub(super) fn write(&mut self, r: &Refinement, out: &mut Vec<u8>) {
        let v = self.vertex_count();
        match r.representative {
            None => put(out, 0),
            Some(p) => {
                put(out, zigzag(p as i32 - self.last_representative as i32) + 1);
                self.last_representative = p;
            }
        }
        if self.has_seams {
            put(out, r.position_of.map_or(0, |p| v - p));
        }
        let first = if r.position_of.is_some() { 3 } else { 0 };
        for k in first..self.channel_count {
            put(out, zigzag(r.row[k].wrapping_sub(self.predicted(r.representative, k))));
        }
        self.corners.add_vertex();
        if let Some(p) = r.representative {
            self.write_moves(p, v, r, out);
        }
        put(out, r.triangles.len() as u32);
        for t in &r.triangles {
            self.corners.add_triangle(*t);
            // The first is the new vertex itself and is not sent.
            put(out, v - t[1]);
            put(out, v - t[2]);
        }
        self.rows.extend_from_slice(&r.row);
    }

    fn write_moves(&mut self, p: u32, v: u32, r: &Refinement, out: &mut Vec<u8>) {
        let mut candidates = std::mem::take(&mut self.candidates);
        self.corners.of(p, &mut candidates);
        let mut moved: Vec<u32> = r.corner_moves.iter().map(|m| 3 * m.triangle + u32::from(m.corner)).collect();
        moved.sort_unstable();
        let moves = |i: usize| moved.binary_search(&candidates[i]).is_ok();
        for byte in 0..candidates.len().div_ceil(8) {
            let bit = |k: usize| byte * 8 + k < candidates.len() && moves(byte * 8 + k);
            out.push((0..8).fold(0, |b, k| b | u8::from(bit(k)) << k));
        }
        self.corners.split(p, v, &candidates, moves);
        self.candidates = candidates;
    }

    /// Reads one record; on [`ReadError::End`] nothing has changed, and more bytes can be tried. A level may use vertices
    /// below `level_start` as representatives only, and add `triangles_left` triangles at most.
    pub(super) fn read(&mut self, reader: &mut Reader, level_start: u32, triangles_left: u32) -> Result<Refinement, ReadError> {
        let v = self.vertex_count();
        let mut refinement = Refinement::default();
        if let Some(code) = reader.varint()?.checked_sub(1) {
            let delta = (code >> 1) as i32 ^ -((code & 1) as i32);
            let p = self.last_representative.wrapping_add_signed(delta);
            if p >= level_start {
                return Err(ReadError::Bad("a representative that is not of an earlier level"));
            }
            refinement.representative = Some(p);
        }
        if self.has_seams {
            refinement.position_of = match reader.varint()? {
                0 => None,
                d => Some(v.checked_sub(d).ok_or(ReadError::Bad("a seam to a vertex before the first"))?),
            };
        }
        if let Some(p) = refinement.position_of {
            refinement.row.extend_from_slice(&self.row(p)[..3]);
        }
        for k in refinement.row.len()..self.channel_count {
            let predicted = self.predicted(refinement.representative, k);
            refinement.row.push(predicted.wrapping_add(reader.signed()?));
        }
        let mut bits: &[u8] = &[];
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.clear();
        if let Some(p) = refinement.representative {
            self.corners.of(p, &mut candidates);
            bits = reader.bytes(candidates.len().div_ceil(8))?;
        }
        let moves = |i: usize| bits[i / 8] >> (i % 8) & 1 != 0;
        let moved = candidates.iter().enumerate().filter(|&(i, _)| moves(i));
        refinement.corner_moves = moved.map(|(_, &c)| CornerMove { triangle: c / 3, corner: (c % 3) as u8, vertex: v }).collect();
        let count = reader.varint()?;
        if count > triangles_left || count > RECORD_LIMIT {
            return Err(ReadError::Bad("more triangles than the table announces"));
        }
        for _ in 0..count {
            let mut other = || v.checked_sub(reader.varint()?).ok_or(ReadError::Bad("a vertex before the first"));
            refinement.triangles.push([v, other()?, other()?]);
        }
        // Nothing can fail from here on.
        self.corners.add_vertex();
        if let Some(p) = refinement.representative {
            self.last_representative = p;
            self.corners.split(p, v, &candidates, moves);
        }
        self.candidates = candidates;
        refinement.triangles.iter().for_each(|t| self.corners.add_triangle(*t));
        self.rows.extend_from_slice(&refinement.row);
        Ok(refinement)
    }

    pub(super) fn write_tail(&mut self, triangles: &[[u32; 3]], moved: &[(u32, Vec<i32>)], out: &mut Vec<u8>) {
        put(out, triangles.len() as u32);
        for t in triangles {
            self.corners.add_triangle(*t);
            t.iter().for_each(|&v| put(out, v));
        }
        put(out, moved.len() as u32);
        let mut last = 0;
        for (v, row) in moved {
            put(out, v - last);
            last = *v;
            for (k, value) in row.iter().enumerate() {
                put(out, zigzag(value.wrapping_sub(self.row(*v)[k])));
            }
            self.set_row(*v, row);
        }
    }
    fn set_row(&mut self, v: u32, row: &[i32]) {
        let at = v as usize * self.channel_count;
        self.rows[at..at + row.len()].copy_from_slice(row);
    }

    /// Reads one of the triangles that have no new vertex.
    pub(super) fn read_triangle(&mut self, reader: &mut Reader) -> Result<[u32; 3], ReadError> {
        let mut t = [0; 3];
        for v in &mut t {
            *v = reader.varint()?;
            if *v >= self.vertex_count() {
                return Err(ReadError::Bad("a triangle uses a vertex that has not arrived"));
            }
        }
        self.corners.add_triangle(t);
        Ok(t)
    }
    /// Reads one moved vertex of an earlier level; `last` is the one before it in the level.
    pub(super) fn read_moved(
        &mut self,
        reader: &mut Reader,
        last: Option<u32>,
        level_start: u32,
    ) -> Result<(u32, Vec<i32>), ReadError> {
        let v = last.unwrap_or(0).checked_add(reader.varint()?).filter(|&v| v < level_start);
        let v = v.filter(|&v| last != Some(v)).ok_or(ReadError::Bad("a moved vertex that is not of an earlier level"))?;
        let row = (0..self.channel_count).map(|k| Ok(self.row(v)[k].wrapping_add(reader.signed()?)));
        let row = row.collect::<Result<Vec<_>, _>>()?;
        self.set_row(v, &row);
        Ok((v, row))
    }
}
