//! `pmesh compare-slod`: SS97's Table 2 and Figure 4 for given models (B.18, B.19).

use crate::error::{CliError, Result};
use crate::{input, output};
use pmesh_build::pipeline::{BuildOptions, Method, Steps, build};
use pmesh_codec::{Arrival, Receiver, slod};
use pmesh_core::ProgressiveMultilevelMesh;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Compare smooth levels of detail with a model alone and with five conventional levels, as SS97's Table 2 does
///
/// Sizes are counted as the paper counts: 12 bytes a vertex and 6 a triangle for the model; a conventional level adds its
/// triangles; the smooth stream has 113 + N bits a vertex and 18 a triangle (more beyond 32,768 vertices, where 16 bits
/// cannot name a vertex, in the mesh no more than in the stream: 12 bytes a triangle then).
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  pmesh compare-slod lamp.obj tub.ply\n  pmesh compare-slod horse.off --svg figure4.svg   triangles against bytes"
)]
pub struct Args {
    /// Meshes (OBJ, PLY, STL, OFF, glTF, GLB)
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Draw the first model's triangles against the bytes that have come, smooth and conventional (Figure 4)
    #[arg(long)]
    svg: Option<PathBuf>,
}

/// Levels of the conventional set, the original included.
const LEVELS: u32 = 5;

struct Row {
    name: String,
    vertices: u64,
    triangles: u64,
    original: u64,
    with_levels: u64,
    smooth: u64,
    /// (bytes, triangles) as they come.
    smooth_curve: Vec<(u64, u64)>,
    level_curve: Vec<(u64, u64)>,
}

pub fn run(args: &Args) -> Result<()> {
    let rows = args.inputs.iter().map(|path| row(path)).collect::<Result<Vec<_>>>()?;
    let mut text =
        String::from("model                  V          T   original   +4 levels     smooth   % original   % with levels\n");
    for r in &rows {
        let part = |of: u64| 100.0 * r.smooth as f64 / of as f64;
        let sizes = (r.original, r.with_levels, r.smooth);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<16} {:>8} {:>10} {:>10} {:>11} {:>10} {:>12.1} {:>15.1}",
            r.name,
            r.vertices,
            r.triangles,
            sizes.0,
            sizes.1,
            sizes.2,
            part(r.original),
            part(r.with_levels)
        );
    }
    output::say(text.trim_end())?;
    match (&args.svg, rows.first()) {
        (Some(path), Some(row)) => output::write_bytes(path, figure(row).as_bytes()),
        _ => Ok(()),
    }
}

fn row(path: &Path) -> Result<Row> {
    let mut model = input::model(path, &input::read(path)?)?;
    model.mesh.vertices.attributes = Default::default();
    model.texture = None;
    let levels = |method, steps| {
        let options = BuildOptions { method, steps, ..Default::default() };
        let stream = build(&model, &options, |_| ()).map_err(CliError::build(path))?;
        let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
        stream.levels.iter().try_for_each(|l| mesh.add_level(l).map(drop))?;
        Ok::<_, CliError>(mesh)
    };
    let mut bytes = Vec::new();
    let report = slod::encode(&levels(Method::Closest, Steps::Single)?, &mut bytes).map_err(CliError::encode(path))?;
    let per_triangle = if report.field_bits == 16 { 6 } else { 12 };
    let (vertices, triangles) = (u64::from(report.vertices), u64::from(report.triangles));
    let conventional = levels(Method::Closest, Steps::Count(LEVELS))?;
    let mut level_curve = vec![(0, 0)];
    let mut sent = 0;
    for level in (0..conventional.level_count()).rev() {
        // A level's triangles are sent anew; the vertices it needs are sent once.
        let before = if level + 1 == conventional.level_count() { 0 } else { conventional.vertex_count(level + 1)? };
        let count = conventional.triangles_at(level)?.len() as u64;
        sent += 12 * u64::from(conventional.vertex_count(level)? - before) + per_triangle * count;
        level_curve.push((sent, level_curve.last().map_or(0, |l: &(u64, u64)| l.1)));
        level_curve.push((sent, count));
    }
    Ok(Row {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        vertices,
        triangles,
        original: 12 * vertices + per_triangle * triangles,
        with_levels: sent,
        smooth: bytes.len() as u64,
        smooth_curve: curve(path, &bytes)?,
        level_curve,
    })
}

/// Triangles after every 256 bytes.
fn curve(path: &Path, bytes: &[u8]) -> Result<Vec<(u64, u64)>> {
    let mut receiver = Receiver::default();
    let mut points = vec![(0, 0)];
    for chunk in bytes.chunks(256) {
        receiver.push(chunk).map_err(|source| CliError::Decode { path: path.into(), source })?;
        while let Some(arrival) = receiver.poll() {
            drop::<Arrival>(arrival);
        }
        let mesh = receiver.mesh();
        let count = mesh.triangle_count(mesh.finest_level()).unwrap_or(0);
        points.push((receiver.bytes(), u64::from(count)));
    }
    Ok(points)
}

/// Figure 4: triangles against bytes.
fn figure(row: &Row) -> String {
    let (width, height, left, bottom) = (640.0, 400.0, 80.0, 50.0);
    let bytes = row.smooth.max(row.with_levels) as f64;
    let x = |b: u64| left + (width - left - 20.0) * b as f64 / bytes;
    let y = |t: u64| height - bottom - (height - bottom - 30.0) * t as f64 / row.triangles.max(1) as f64;
    let line =
        |points: &[(u64, u64)]| points.iter().map(|&(b, t)| format!("{:.1},{:.1}", x(b), y(t))).collect::<Vec<_>>().join(" ");
    let mut grid = String::new();
    for i in 0..=4u64 {
        let (b, t) = ((bytes * i as f64 / 4.0) as u64, row.triangles * i / 4);
        let (gx, gy) = (x(b), y(t));
        let _ = write!(
            grid,
            r##"<path d="M{left} {gy:.1}H{:.1}M{gx:.1} {:.1}V30" stroke="#ddd"/><text x="{:.1}" y="{:.1}" text-anchor="end">{t}</text><text x="{gx:.1}" y="{:.1}" text-anchor="middle">{b}</text>"##,
            width - 20.0,
            height - bottom,
            left - 6.0,
            gy + 4.0,
            height - bottom + 18.0
        );
    }
    format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12" fill="#333">
<rect width="{width}" height="{height}" fill="#fff"/>
{grid}
<polyline points="{}" fill="none" stroke="#888" stroke-width="1.5" stroke-dasharray="5 3"/>
<polyline points="{}" fill="none" stroke="#06c" stroke-width="2"/>
<text x="{left}" y="20">{}: triangles against bytes; smooth (solid), five conventional levels (dashed)</text>
</svg>
"##,
        line(&row.level_curve),
        line(&row.smooth_curve),
        row.name
    )
}
