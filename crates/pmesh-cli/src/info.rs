//! `pmesh info`: what a stream holds, and what each byte of it buys.

use crate::error::{CliError, Result};
use crate::{input, output};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Show what a stream holds: its levels with bytes, vertices, triangles and error
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  pmesh info statue.pmesh\n  pmesh info statue.pmesh --json")]
pub struct Args {
    /// The stream
    input: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    format: String,
    file_bytes: u64,
    /// Bytes that a stream with a table says it has.
    announced_bytes: Option<u64>,
    vertices: u32,
    triangles: u32,
    bits_per_vertex: f64,
    position_bits: Option<u8>,
    normals: bool,
    colors: bool,
    texcoords: bool,
    texture_bytes: Option<usize>,
    seam_vertices: usize,
    moving_vertices: u32,
    memory_bytes: usize,
    levels: Vec<LevelRow>,
    /// Bytes by what they say, fractions counted; where the format keeps these apart.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    components: BTreeMap<&'static str, f64>,
    /// What the format's own paper counts.
    statistics: Vec<(&'static str, String)>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct LevelRow {
    level: u32,
    /// Bytes after which it can be shown; for streams without a table, to the next 256.
    bytes: u64,
    vertices: u32,
    triangles: u32,
    error: Option<f32>,
}

/// What the components are, for people.
const COMPONENTS: [(&str, &str); 10] = [
    ("headers", "header and level table"),
    ("base", "base mesh"),
    ("flags", "which vertices split"),
    ("connectivity", "which triangles go to the new ones"),
    ("geometry", "where the new ones stand"),
    ("attributes", "attributes of the new ones"),
    ("level_ends", "where levels begin and end"),
    ("levels", "levels"),
    ("loose", "vertices of no triangle"),
    ("images", "images"),
];

/// Most rows of the table for people; `--json` has them all.
const ROWS: usize = 64;

pub fn run(args: &Args) -> Result<()> {
    let bytes = input::read(&args.input)?;
    let mut stream = input::decode(&bytes, true);
    if let Some(source) = stream.error.clone().filter(|_| stream.receiver.mesh().arrived_levels() == 0) {
        return Err(CliError::Decode { path: args.input.clone(), source });
    }
    if !stream.elsewhere.is_empty() {
        return Err(CliError::elsewhere(&args.input, &stream.elsewhere));
    }
    stream.receiver.mesh_mut().shrink_to_fit();
    let mesh = stream.receiver.mesh();
    let mut info = stream.receiver.info().cloned().unwrap_or_default();
    if let Some(Ok(head)) = pmesh_view::is_file(&bytes).then(|| pmesh_view::Head::read(&bytes)).and_then(std::result::Result::ok)
    {
        (info.format, info.position_bits) = ("hierarchy for views (.pmesh)", head.base.grid.position_bits);
    }
    let count = mesh.level_count();
    let mut rows = Vec::new();
    for level in (mesh.finest_level()..count).rev() {
        let step = (count - 1 - level) as usize;
        let entry = info.levels.as_ref().and_then(|l| l.get(step));
        rows.push(LevelRow {
            level,
            bytes: entry.map_or(stream.level_bytes[step], |e| e.end_byte),
            vertices: mesh.vertex_count(level)?,
            triangles: mesh.triangle_count(level)?,
            error: entry.map(|e| e.error),
        });
    }
    let finest = rows.last().map_or((0, 0), |r| (r.vertices, r.triangles));
    let set = mesh.attribute_set();
    let report = Report {
        format: info.format.into(),
        file_bytes: bytes.len() as u64,
        announced_bytes: info.total_bytes,
        vertices: finest.0,
        triangles: finest.1,
        bits_per_vertex: bytes.len() as f64 * 8.0 / f64::from(finest.0.max(1)),
        position_bits: info.position_bits,
        normals: set.normals,
        colors: set.colors,
        texcoords: set.texcoords,
        texture_bytes: stream.texture.as_ref().map(|t| t.bytes.len()),
        seam_vertices: mesh.seams().len(),
        moving_vertices: mesh.vertices().len() as u32 - finest.0,
        memory_bytes: mesh.memory_bytes(),
        levels: rows,
        components: stream.receiver.components().into_iter().collect(),
        statistics: stream.receiver.statistics(),
        warnings: stream.warnings,
    };
    if args.json {
        let text = serde_json::to_string_pretty(&report).map_err(|e| CliError::Other(e.to_string()))?;
        output::say(&text)?;
    } else {
        output::say(&shown(&report))?;
    }
    // What is there has been shown; that it is not all is still a failure.
    stream.error.map_or(Ok(()), |source| Err(CliError::Decode { path: args.input.clone(), source }))
}

/// The report for people.
fn shown(r: &Report) -> String {
    let mut lines = Vec::new();
    lines.push(format!("format      {}", r.format));
    let cut = r.announced_bytes.filter(|&all| all > r.file_bytes).map_or(String::new(), |all| format!(" of {all}"));
    lines.push(format!("bytes       {}{cut} ({:.2} bits a vertex)", r.file_bytes, r.bits_per_vertex));
    lines.push(format!("finest      {} vertices, {} triangles", r.vertices, r.triangles));
    lines.push(format!(
        "positions   {}",
        r.position_bits.map_or("exact 32-bit floats".into(), |b| format!("{b} bits a coordinate"))
    ));
    let names = [(r.normals, "normals"), (r.colors, "colours"), (r.texcoords, "texture coordinates")];
    let present: Vec<_> = names.iter().filter(|n| n.0).map(|n| n.1).collect();
    lines.push(format!("attributes  {}", if present.is_empty() { "none".into() } else { present.join(", ") }));
    if let Some(bytes) = r.texture_bytes {
        lines.push(format!("texture     {bytes} bytes"));
    }
    if r.seam_vertices > 0 {
        lines.push(format!("seams       {} vertices share a position with another", r.seam_vertices));
    }
    if r.moving_vertices > 0 {
        lines.push(format!("moves       {} places of vertices that move between levels", r.moving_vertices));
    }
    lines.push(format!("in memory   {} bytes", r.memory_bytes));
    lines.push("\n level      bytes  of file   vertices  triangles      error (model units)".to_string());
    let (count, mut last) = (r.levels.len(), 0);
    for (i, l) in r.levels.iter().enumerate() {
        // A stream with a level a vertex shows one each time its triangles have grown by half.
        if count > ROWS && i > 0 && i + 1 < count && l.triangles < last + last / 2 + 1 {
            continue;
        }
        last = l.triangles;
        let error = l.error.map_or("-".into(), |e| format!("{e:.3e}"));
        let part = 100.0 * l.bytes as f64 / r.file_bytes as f64;
        lines
            .push(format!("{:>6} {:>10} {:>7.2} % {:>10} {:>10} {:>10}", l.level, l.bytes, part, l.vertices, l.triangles, error));
    }
    if !r.components.is_empty() {
        lines.push("\n     bytes  of file  bits a vertex".to_string());
    }
    let present = COMPONENTS.iter().filter_map(|(key, name)| r.components.get(key).map(|bytes| (name, bytes)));
    for (name, bytes) in present.filter(|c| *c.1 > 0.0) {
        let (part, each) = (100.0 * bytes / r.file_bytes as f64, 8.0 * bytes / f64::from(r.vertices.max(1)));
        lines.push(format!("{bytes:>10.0} {part:>6.2} % {each:>14.3}  {name}"));
    }
    lines.extend(r.statistics.iter().map(|(name, value)| format!("{name:<12} {value}")));
    lines.extend(r.warnings.iter().map(|w| format!("warning: {w}")));
    lines.join("\n")
}
