//! The `pmesh` command. One file a subcommand; reading any format is in `input`, writing meshes in `output`.

mod compare;
mod compare_slod;
mod decode;
mod encode;
mod error;
mod info;
mod input;
mod look;
mod output;
mod progress;
mod sample;
mod serve;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Progressive meshes for the web: encode a model once, show it at any level of detail while it arrives.
///
/// A .pmesh file is served by any web server and shown by <p-mesh src="model.pmesh">.
#[derive(Parser)]
#[command(
    version,
    after_help = "Examples:\n  pmesh sample globe -o globe.pmesh       a model to try with\n  pmesh encode statue.obj -o statue.pmesh encode your own\n  pmesh info statue.pmesh                 what each byte buys\n  pmesh decode statue.pmesh -o half.ply --level 4.5\n\nExit codes: 0 done, 1 the input is bad or unreadable, 2 the command line is wrong."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// No progress bars and no notes; warnings and errors still show.
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    #[command(visible_alias = "convert")]
    Encode(encode::Args),
    Info(info::Args),
    Decode(decode::Args),
    Compare(compare::Args),
    CompareSlod(compare_slod::Args),
    Sample(sample::Args),
    Serve(serve::Args),
    Look(look::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Encode(args) => encode::run(&args, cli.quiet),
        Command::Info(args) => info::run(&args),
        Command::Decode(args) => decode::run(&args, cli.quiet),
        Command::Compare(args) => compare::run(&args),
        Command::CompareSlod(args) => compare_slod::run(&args),
        Command::Sample(args) => sample::run(&args, cli.quiet),
        Command::Look(args) => look::run(&args, cli.quiet),
        Command::Serve(args) => serve::run(args, cli.quiet),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
