//! `pmesh sample`: a built-in model as a stream or a mesh.

use crate::error::{CliError, Result};
use crate::{encode, output};
use pmesh_build::sample::{SAMPLES, sample, sample_levels};
use std::path::PathBuf;

/// Write a built-in procedural sample, as any stream (.pmesh, .pits, .slod …) or a mesh (.ply, .obj)
#[derive(clap::Args)]
#[command(after_help = samples_help())]
pub struct Args {
    /// Name of the sample
    name: String,
    /// Where to write
    #[arg(short, long)]
    output: PathBuf,
    #[command(flatten)]
    how: encode::How,
}

fn samples_help() -> String {
    let rows = SAMPLES.iter().map(|(name, what)| format!("  {name:<11} {what}\n"));
    format!("Samples:\n{}\nExample:\n  pmesh sample marble -o marble.pmesh", rows.collect::<String>())
}

pub fn run(args: &Args, quiet: bool) -> Result<()> {
    let model = sample(&args.name).ok_or_else(|| {
        let names: Vec<_> = SAMPLES.iter().map(|s| s.0).collect();
        CliError::Usage(format!("no sample is called {:?}: there are {}", args.name, names.join(", ")))
    })?;
    let name = args.output.to_string_lossy().to_ascii_lowercase();
    if name.ends_with(".ply") || name.ends_with(".obj") {
        args.how.warn_of_plain_mesh(&args.output);
        output::write(&args.output, &model.mesh)?;
        let counts = (model.mesh.vertices.len(), model.mesh.triangles.len());
        return if quiet {
            Ok(())
        } else {
            output::say(&format!("{}: {} vertices, {} triangles", args.output.display(), counts.0, counts.1))
        };
    }
    let own_levels = !encode::Stream::of(&args.output, &args.how)?.finds_its_own_levels();
    match sample_levels(&args.name).filter(|_| own_levels) {
        Some(stream) => {
            args.how.warn_of_kept_levels(&args.output);
            encode::write_stream(stream, &args.output, &args.how, quiet)
        }
        None => encode::encode_model(model, &args.output, &args.output, &args.how, quiet),
    }
}
