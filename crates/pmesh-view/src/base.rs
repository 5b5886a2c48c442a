//! The message with the base mesh, which a file of blocks begins with, too.

use crate::error::ProtocolError;
use crate::fans::{Fan, FanBounds};
use crate::message::{BASE_KIND, Reader};
use pmesh_codec::pmesh::Quantisation;
use pmesh_codec::range::{Chance, Coder, Encoder, RangeDecoder};
use pmesh_codec::{ITEM_LIMIT, SingleMesh, code_mesh};
use pmesh_core::hierarchy::Bounds;
use pmesh_core::surface::{NONE, Surface, next, previous};

/// Most vertices and triangles of a base mesh.
const BASE_LIMIT: u32 = 1 << 22;
/// Most nodes of a hierarchy.
const TOTAL_LIMIT: u64 = 1 << 31;

/// The base mesh, and what both ends must know alike.
#[derive(Clone, Debug, PartialEq)]
pub struct Base {
    /// Names the model's state: who resumes must have the same.
    pub fingerprint: u64,
    /// Unit of the lengths of bounds.
    pub unit: f64,
    /// Grid of the positions.
    pub grid: Quantisation,
    /// Of the roots.
    pub positions: Vec<[f32; 3]>,
    /// Of the roots.
    pub bounds: Vec<Bounds>,
    /// Between the roots.
    pub triangles: Vec<[u32; 3]>,
    /// Nodes of the whole hierarchy.
    pub total: u64,
    /// Smallest and largest corner of the box about all of it.
    pub extent: [[f32; 3]; 2],
}

/// How a base mesh is numbered in its message: the old number of each root, and the triangles, by the new ones.
pub(crate) struct Order {
    pub(crate) roots: Vec<u32>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Bytes of the message, and its order. O(n). Errors: triangles between roots that are not there.
pub(crate) fn write(base: &Base) -> Result<(Vec<u8>, Order), ProtocolError> {
    let mut out = vec![BASE_KIND];
    out.extend(base.fingerprint.to_le_bytes());
    out.extend(base.total.to_le_bytes());
    out.extend(base.unit.to_le_bytes());
    out.push(base.grid.position_bits.unwrap_or(0));
    base.grid.position_origin.iter().for_each(|x| out.extend(x.to_le_bytes()));
    out.extend(base.grid.position_step.to_le_bytes());
    base.extent.as_flattened().iter().for_each(|x| out.extend(x.to_le_bytes()));
    let counts = [base.positions.len() as u32, base.triangles.len() as u32];
    counts.iter().for_each(|n| out.extend(n.to_le_bytes()));
    if base.triangles.as_flattened().iter().any(|&v| v >= counts[0]) {
        return Err(ProtocolError::Unexpected("a base mesh with triangles between vertices that are not there"));
    }
    let rows: Vec<_> = base.positions.iter().map(|&p| base.grid.position_row(p)).collect();
    let mut coder = Encoder::new();
    let coded = code_mesh(&mut coder, (counts[0], counts[1], 0), Some((&rows, &base.triangles)));
    let SingleMesh { rows, triangles, vertex_order } = coded.map_err(ProtocolError::Unexpected)?;
    let bounds: Vec<_> = vertex_order.iter().map(|&v| base.bounds[v as usize]).collect();
    code_bounds(&mut coder, (&base.grid, base.unit), (&rows, &triangles), Some(&bounds));
    let mut payload = coder.finish();
    // What packs better than a reader believes is filled up.
    payload.resize(payload.len().max(counts[0].max(counts[1]) as usize / ITEM_LIMIT), 0);
    out.extend(payload);
    Ok((out, Order { roots: vertex_order, triangles }))
}

/// Reads what follows the kind. Errors: a base mesh that cannot be.
pub(crate) fn read(r: &mut Reader) -> Result<Base, ProtocolError> {
    let fingerprint = u64::from_le_bytes(r.array()?);
    let total = u64::from_le_bytes(r.array()?);
    let unit = f64::from_le_bytes(r.array()?);
    let bits = r.u8()?;
    let position_origin = [r.f32()?, r.f32()?, r.f32()?];
    let position_step = f64::from_le_bytes(r.array()?);
    let good = position_origin.iter().all(|x| x.is_finite()) && position_step.is_finite() && position_step >= 0.0 && bits <= 24;
    if !good || (bits > 0 && position_step == 0.0) {
        return r.error("a grid that is none");
    }
    let extent = [[r.f32()?, r.f32()?, r.f32()?], [r.f32()?, r.f32()?, r.f32()?]];
    if (0..3).any(|k| !(extent[0][k].is_finite() && extent[1][k].is_finite() && extent[0][k] <= extent[1][k])) {
        return r.error("a box that is none");
    }
    let grid = Quantisation { position_bits: (bits > 0).then_some(bits), position_origin, position_step, ..Default::default() };
    let (vertices, triangles) = (u32::from_le_bytes(r.array()?), u32::from_le_bytes(r.array()?));
    if total < u64::from(vertices) || total > TOTAL_LIMIT {
        return r.error("a hierarchy of so many nodes");
    }
    if vertices.max(triangles) > BASE_LIMIT {
        return r.error("a base mesh of so many vertices or triangles");
    }
    let payload = r.rest();
    let mut coder = RangeDecoder::new(payload.to_vec());
    let mesh = match code_mesh(&mut coder, (vertices, triangles, payload.len()), None) {
        Ok(mesh) => mesh,
        Err(what) => return r.error(what),
    };
    let bounds = code_bounds(&mut coder, (&grid, unit), (&mesh.rows, &mesh.triangles), None);
    if coder.ran_out() {
        return r.error("it ends before the base mesh is whole");
    }
    let positions = mesh.rows.iter().map(|&row| grid.position_of_row(row)).collect();
    Ok(Base { fingerprint, unit, grid, positions, bounds, triangles: mesh.triangles, total, extent })
}

/// Bounds of the roots, by their fans.
fn code_bounds<C: Coder>(
    coder: &mut C,
    (grid, unit): (&Quantisation, f64),
    (rows, triangles): (&[[i32; 3]], &[[u32; 3]]),
    truth: Option<&[Bounds]>,
) -> Vec<Bounds> {
    let surface = Surface::new(triangles.to_vec(), rows.len() as u32);
    let at = |v: u32| grid.position_of_row(rows[v as usize]).map(f64::from);
    let (mut leaf, mut model, mut about) = (Chance::default(), FanBounds::default(), Vec::new());
    let mut code = |v: u32| {
        let own = truth.map_or(Bounds::default(), |b| b[v as usize]);
        if coder.bit(&mut leaf, own.is_leaf()) {
            return Bounds::default();
        }
        about.clear();
        let (mut last, start) = (NONE, surface.corner_of[v as usize]);
        if start != NONE {
            for c in surface.around(start) {
                about.push(at(surface.vertex(next(c))));
                last = c;
            }
        }
        let closed = last != NONE && surface.turn(last) != NONE;
        if last != NONE && !closed {
            about.push(at(surface.vertex(previous(last))));
        }
        let fan = Fan::of(at(v), &about, closed, unit);
        model.code(coder, (0, 0), (&fan.above(), None), &fan, &own)
    };
    (0..rows.len() as u32).map(&mut code).collect()
}
