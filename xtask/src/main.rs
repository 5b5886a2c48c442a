//! Chores in Rust, so that two commands do everything: `cargo xtask demo` and `cargo xtask test`.

mod build;
mod fuzz;
mod peers;
mod plot;
mod prefixes;
mod serve;
mod shell;
mod test;
mod tools;

use clap::{Parser, Subcommand};
use shell::Result;
use std::path::PathBuf;
use std::process::ExitCode;

/// Builds, shows and tests pmesh.
#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Get what is missing, build, encode the samples and any MESH, and serve the gallery on localhost
    Demo {
        /// Meshes to show beside the samples: OBJ, PLY, STL, OFF, glTF, GLB
        meshes: Vec<PathBuf>,
        /// Bytes a second that streams are sent at, such as 200k or 2M; unlimited by default
        #[arg(long, value_parser = serve::parse_rate)]
        throttle: Option<u64>,
        /// Port; 0 takes any free one
        #[arg(long, default_value_t = 8080)]
        port: u16,
    },
    /// Run every test: native, docs, lints, both browsers, the page end to end. Installs browsers where it can
    Test {
        /// Only these parts: lint, native, fuzz, wasm, browser, e2e
        #[arg(long, value_delimiter = ',')]
        only: Vec<String>,
    },
    /// Serve www/ and pkg/ as they are
    Serve {
        #[arg(long, value_parser = serve::parse_rate)]
        throttle: Option<u64>,
        #[arg(long, default_value_t = 8080)]
        port: u16,
    },
    /// Build the browser modules in release and report their sizes
    Build,
    /// Measure natively and in Chromium: encode, decode, level selection, memory; with --quality the simplifier's error; `bench
    /// peers [MESH…]` sets our streams beside Draco and meshoptimizer, `bench prefix [MESH…]` every part of ours beside the best file
    /// of its size, `bench view-dependent MESH…` measures streams that follow a view, beside the figures of the paper
    Bench {
        /// "peers", "prefix" or "view-dependent" first, or meshes; the samples, and those in ../shared/models, by default
        meshes: Vec<PathBuf>,
        /// Where the figures of `bench view-dependent` go, too
        #[arg(long)]
        json: Option<PathBuf>,
        /// Where every figure of `bench peers` goes, too
        #[arg(long)]
        csv: Option<PathBuf>,
        /// Measure simplification error instead
        #[arg(long)]
        quality: bool,
    },
    /// One model as every stream: bytes, first picture, decoding time natively and in Chromium, error after 5, 15 and 30 kB
    Compare {
        /// Meshes: OBJ, PLY, STL, OFF, glTF, GLB
        #[arg(required = true)]
        meshes: Vec<PathBuf>,
    },
    /// Throw made-up bytes at the decoders, and made-up meshes at the encoders, for a while; needs a C++ compiler
    Fuzz {
        /// decode, cuts or round_trip; all by default
        targets: Vec<String>,
        /// Seconds for each
        #[arg(long, default_value_t = 60)]
        seconds: u64,
    },
    /// Renew the screenshots of the README in docs/
    Screenshots,
}

fn main() -> ExitCode {
    match run(Cli::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("\nxtask: {message}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<()> {
    shell::own_path()?;
    std::env::set_current_dir(shell::root()).map_err(|e| format!("the project folder: {e}"))?;
    match command {
        Command::Demo { meshes, throttle, port } => {
            build::everything(&meshes)?;
            serve::run(port, throttle)
        }
        Command::Test { only } => test::run_parts(&only),
        Command::Serve { throttle, port } => serve::run(port, throttle),
        Command::Build => build::modules().map(|_| ()),
        Command::Bench { meshes, csv, .. } if meshes.first().is_some_and(|m| m.as_os_str() == "peers") => {
            peers::run(&meshes[1..], csv.as_deref())
        }
        Command::Bench { meshes, .. } if meshes.first().is_some_and(|m| m.as_os_str() == "prefix") => prefixes::run(&meshes[1..]),
        Command::Bench { meshes, json, .. } if meshes.first().is_some_and(|m| m.as_os_str() == "view-dependent") => {
            test::bench_views(&meshes[1..], json.as_deref())
        }
        Command::Bench { meshes, quality, .. } => test::bench(&meshes, quality),
        Command::Compare { meshes } => test::compare(&meshes),
        Command::Fuzz { targets, seconds } => fuzz::run_targets(&targets, seconds),
        Command::Screenshots => test::screenshots(),
    }
}
