//! Levels to text: only the needed representatives (A.10), the immediate parent and the whole chain where it is missing.

use super::{SURFACE_PARTITION_LINE, TextOptions, TextVariant};
use crate::EncodeError;
use pmesh_core::forest::NO_REPRESENTATIVE;
use pmesh_core::{AttributeSet, ProgressiveMultilevelMesh};
use std::collections::HashSet;
use std::io::Write;

/// Writes every level of `mesh`; floats are printed so that they read back bit for bit. O(n).
///
/// Errors: the mesh has attributes or vertices that move, which the format cannot carry.
pub fn write(mesh: &ProgressiveMultilevelMesh, options: TextOptions, out: &mut impl Write) -> Result<(), EncodeError> {
    if mesh.attribute_set() != AttributeSet::default() {
        let way_out = "write a .pmesh, or drop normals, colours and texture coordinates first";
        return Err(EncodeError::Unsupported { what: "vertex attributes", way_out });
    }
    if mesh.to_levels().is_none() {
        let way_out = "use a simplifier that keeps vertices in place";
        return Err(EncodeError::Unsupported { what: "vertices that move between levels", way_out });
    }
    if mesh.has_retired() {
        let way_out = "decode it to a mesh and encode that";
        return Err(EncodeError::Unsupported { what: "triangles that finer levels replace", way_out });
    }
    let partition = options.variant == TextVariant::SurfacePartition;
    if partition {
        writeln!(out, "{SURFACE_PARTITION_LINE}")?;
    }
    writeln!(out, "#{}-level progressive mesh", mesh.level_count())?;
    let mut named = HashSet::new();
    let (mut v0, mut t0) = (0, 0);
    for level in (0..mesh.level_count()).rev() {
        let (v1, t1) = (mesh.vertex_end(level)?, mesh.triangle_count(level)?);
        writeln!(out, "{{#level {level} vertices ({})", v1 - v0)?;
        let dimension = usize::from(options.dimension.unwrap_or(3));
        for p in &mesh.vertices().positions[v0 as usize..v1 as usize] {
            write_row(out, &p[..dimension])?;
        }
        writeln!(out, "}}\n{{#level {level} triangles ({})", t1 - t0)?;
        for triangle in &mesh.triangles()[t0 as usize..t1 as usize] {
            let mut row = triangle.to_vec();
            if !partition {
                row.extend(needed_representatives(mesh, triangle, v1, &mut named));
            }
            write_row(out, &row)?;
        }
        writeln!(out, "}}")?;
        if partition && v0 == 0 {
            writeln!(out, "{{#representatives of vertices {v1} and on")?;
            for &parent in &mesh.representatives()[v1 as usize..] {
                let parent = if parent == NO_REPRESENTATIVE { -1 } else { i64::from(parent) };
                write_row(out, &[parent])?;
            }
            writeln!(out, "}}")?;
        }
        (v0, t0) = (v1, t1);
    }
    Ok(())
}

fn write_row(out: &mut impl Write, values: &[impl std::fmt::Display]) -> std::io::Result<()> {
    for (i, value) in values.iter().enumerate() {
        write!(out, "{}{value}", if i == 0 { "" } else { ", " })?;
    }
    writeln!(out)
}

/// The representatives to print behind a triangle, in the order in which a reader asks for them.
fn needed_representatives(
    mesh: &ProgressiveMultilevelMesh,
    triangle: &[u32; 3],
    count: u32,
    named: &mut HashSet<u32>,
) -> Vec<u32> {
    let mut row = Vec::new();
    for &corner in triangle {
        let mut v = corner;
        while v >= count && named.insert(v) {
            let parent = mesh.representatives()[v as usize];
            row.push(parent);
            v = parent;
        }
    }
    row
}
