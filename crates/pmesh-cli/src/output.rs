//! Meshes out: PLY (binary, little-endian) and OBJ, with all attributes.

use crate::error::{CliError, Result};
use pmesh_core::IndexedMesh;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes `mesh` as the extension of `path` says.
pub fn write(path: &Path, mesh: &IndexedMesh) -> Result<()> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    let writer: fn(&mut BufWriter<File>, &IndexedMesh) -> std::io::Result<()> = match extension.as_str() {
        "ply" => ply,
        "obj" => obj,
        _ => return Err(CliError::Usage(format!("{}: write .ply or .obj", path.display()))),
    };
    let mut file = BufWriter::new(File::create(path).map_err(CliError::io(path))?);
    writer(&mut file, mesh).and_then(|()| file.flush()).map_err(CliError::io(path))
}

/// Prints a line. Whoever closed the pipe has seen enough: that is no error.
pub fn say(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(CliError::Other(e.to_string())),
        _ => Ok(()),
    }
}

/// Writes a whole file at once.
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(CliError::io(path))
}

fn ply(out: &mut BufWriter<File>, mesh: &IndexedMesh) -> std::io::Result<()> {
    let v = &mesh.vertices;
    let a = &v.attributes;
    writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment written by pmesh\nelement vertex {}", v.len())?;
    let mut properties = vec!["float x", "float y", "float z"];
    let set = v.set();
    if set.normals {
        properties.extend(["float nx", "float ny", "float nz"]);
    }
    // Bytes where they say it all, as most colours do.
    let byte = |x: f32| (x * 255.0).round() / 255.0 == x && (0.0..=1.0).contains(&x);
    let bytes = a.colors.iter().flatten().all(|&x| byte(x));
    match (set.colors, bytes) {
        (true, true) => properties.extend(["uchar red", "uchar green", "uchar blue", "uchar alpha"]),
        (true, false) => properties.extend(["float red", "float green", "float blue", "float alpha"]),
        _ => {}
    }
    if set.texcoords {
        properties.extend(["float u", "float v"]);
    }
    for p in properties {
        writeln!(out, "property {p}")?;
    }
    writeln!(out, "element face {}\nproperty list uchar uint vertex_indices\nend_header", mesh.triangles.len())?;
    let floats = |out: &mut BufWriter<File>, f: &[f32]| f.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()));
    for i in 0..v.len() {
        floats(out, &v.positions[i])?;
        a.normals.get(i).map_or(Ok(()), |n| floats(out, n))?;
        match a.colors.get(i) {
            Some(c) if bytes => out.write_all(&c.map(|x| (x * 255.0).round() as u8))?,
            Some(c) => floats(out, c)?,
            None => {}
        }
        a.texcoords.get(i).map_or(Ok(()), |t| floats(out, t))?;
    }
    for t in &mesh.triangles {
        out.write_all(&[3])?;
        t.iter().try_for_each(|i| out.write_all(&i.to_le_bytes()))?;
    }
    Ok(())
}

fn obj(out: &mut BufWriter<File>, mesh: &IndexedMesh) -> std::io::Result<()> {
    let v = &mesh.vertices;
    let a = &v.attributes;
    writeln!(out, "# written by pmesh")?;
    for (i, [x, y, z]) in v.positions.iter().enumerate() {
        match a.colors.get(i) {
            Some([r, g, b, _]) => writeln!(out, "v {x} {y} {z} {r} {g} {b}")?,
            None => writeln!(out, "v {x} {y} {z}")?,
        }
    }
    a.texcoords.iter().try_for_each(|[u, v]| writeln!(out, "vt {u} {v}"))?;
    a.normals.iter().try_for_each(|[x, y, z]| writeln!(out, "vn {x} {y} {z}"))?;
    let set = v.set();
    for t in &mesh.triangles {
        let corner = |i: u32| match (set.texcoords, set.normals) {
            (true, true) => format!("{0}/{0}/{0}", i + 1),
            (true, false) => format!("{0}/{0}", i + 1),
            (false, true) => format!("{0}//{0}", i + 1),
            (false, false) => format!("{}", i + 1),
        };
        writeln!(out, "f {} {} {}", corner(t[0]), corner(t[1]), corner(t[2]))?;
    }
    Ok(())
}
