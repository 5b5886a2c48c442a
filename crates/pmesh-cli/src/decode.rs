//! `pmesh decode`: a stream, or a part of it, to a mesh of one level.

use crate::error::{CliError, Result};
use crate::{input, output};
use pmesh_build::picture;
use pmesh_codec::Receiver;
use std::path::PathBuf;

/// Decode a stream to a mesh: its finest level, any other, or what the first bytes give
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  pmesh decode statue.pmesh -o statue.ply\n  pmesh decode statue.pmesh -o coarse.obj --level 6\n  pmesh decode statue.pmesh -o morph.ply --level 2.5     half way between levels 2 and 3\n  pmesh decode statue.pmesh -o early.ply --prefix 20000  what a client has after 20,000 bytes"
)]
pub struct Args {
    /// The stream
    input: PathBuf,
    /// Where to write: .ply or .obj
    #[arg(short, long)]
    output: PathBuf,
    /// Level of detail, 0 the finest; fractions morph. By default all that is there, exactly as encoded: of a compact stream also
    /// the part that has arrived of the next level
    #[arg(long, allow_negative_numbers = true)]
    level: Option<f64>,
    /// Use only this many bytes of the file
    #[arg(long)]
    prefix: Option<u64>,
    /// Write what arrived before an error, instead of stopping there
    #[arg(long)]
    keep_going: bool,
}

pub fn run(args: &Args, quiet: bool) -> Result<()> {
    let bytes = input::read(&args.input)?;
    let end = args.prefix.map_or(bytes.len(), |p| usize::try_from(p).unwrap_or(usize::MAX).min(bytes.len()));
    let stream = input::decode(&bytes[..end], end == bytes.len());
    stream.warn(&args.input);
    let mesh = stream.receiver.mesh();
    if let Some(source) = stream.error {
        if !args.keep_going || mesh.arrived_levels() == 0 {
            return Err(CliError::Decode { path: args.input.clone(), source });
        }
        eprintln!("warning: {}: {source}", args.input.display());
    }
    if !stream.elsewhere.is_empty() {
        return Err(CliError::elsewhere(&args.input, &stream.elsewhere));
    }
    if mesh.arrived_levels() == 0 {
        let first = stream.receiver.info().and_then(|i| i.levels.as_ref()?.first().map(|l| l.end_byte));
        let hint = first.map_or(String::new(), |b| format!("; the first takes {b}"));
        return Err(CliError::Other(format!("{}: no level is complete within {end} bytes{hint}", args.input.display())));
    }
    let out = match args.level {
        None => stream.receiver.newest_mesh(),
        Some(x) => mesh.mesh_at(x)?,
    };
    output::write(&args.output, &out)?;
    if let Some(texture) = &stream.texture {
        // Beside the mesh, which names none: .ply cannot, .obj only by a third file.
        let (ending, bytes) = picture::to_file(texture).map_err(CliError::build(&args.input))?;
        let stem = args.output.file_stem().unwrap_or_default().to_string_lossy();
        let path = args.output.with_file_name(format!("{stem}-image.{ending}"));
        output::write_bytes(&path, &bytes)?;
        if !quiet {
            output::say(&format!("{}: the base-colour image", path.display()))?;
        }
    }
    if !quiet {
        let level = args.level.unwrap_or(mesh.finest_level().into());
        let part = if args.level.is_none() { part_of_next(&stream.receiver, out.vertices.len()) } else { String::new() };
        output::say(&format!(
            "{}: level {level}{part}, {} vertices, {} triangles",
            args.output.display(),
            out.vertices.len(),
            out.triangles.len()
        ))?;
    }
    Ok(())
}

/// Says how much of the level that is still arriving is in the mesh.
fn part_of_next(receiver: &Receiver, shown: usize) -> String {
    let mesh = receiver.mesh();
    let Some(next) = mesh.finest_level().checked_sub(1).filter(|_| receiver.shows_part()) else { return String::new() };
    let table = receiver.info().and_then(|i| i.levels.as_deref()).unwrap_or_default();
    let total = |step: u32| table.get(step as usize).map_or(0, |l| l.vertex_count);
    let (before, after) = (total(mesh.arrived_levels() - 1), total(mesh.arrived_levels()));
    let here = (shown as u32).saturating_sub(before);
    format!(" and {:.0} % of level {next}", 100.0 * f64::from(here) / f64::from(after.saturating_sub(before).max(1)))
}
