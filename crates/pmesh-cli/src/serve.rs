//! `pmesh serve`: a folder over HTTP, and its models by what a client looks at.

use crate::error::{CliError, Result};
use clap::Parser;
use pmesh_server::Config;
use std::io::IsTerminal;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;
use tokio::net::TcpListener;
use tracing_subscriber::EnvFilter;

/// Serve a folder: files, with ranges, and view-dependent streams of the .pmesh files in it over WebSockets.
///
/// Any web server will do for <p-mesh src="model.pmesh">. This one also speaks the protocol of docs/PROTOCOL.md on any path, for programs that follow a view: the client gets what it looks
/// at, each piece once: positions only, rounded to --bits, vertices of no triangle left out. The first client of a model waits until it is prepared, seconds for a million triangles; one that changes is prepared anew. A file for views (pmesh encode --profile views) has its own --bits, and takes about as long. `pmesh look ws://HOST:PORT --list` names the models. Hidden files (.name) are not served, what links lead to is. /metrics is for Prometheus, /health for a load balancer. Servers share nothing: put any number of them behind one, with the same folder.
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  pmesh serve models                            http://127.0.0.1:8080\n  pmesh serve models --address 0.0.0.0 --port 80 --origin https://example.org\n  pmesh serve models --rate 250000              as a link of 2 Mbit/s\n\nCtrl+C, or SIGTERM, closes: sessions are told to connect again, which they may do elsewhere."
)]
pub struct Args {
    /// The folder
    folder: PathBuf,
    /// Address to listen at; 0.0.0.0 is all there are
    #[arg(long, default_value = "127.0.0.1")]
    address: IpAddr,
    /// Port; 0 takes any free one, which is printed
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// Bits a coordinate for views, 8 to 16; of files for views those that they have. What is asked for by HTTP is served as it is
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u8).range(8..=16))]
    bits: u8,
    /// Most sessions at a time
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    sessions: u32,
    /// Bytes a second for each session; as fast as it goes by default
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    rate: Option<u64>,
    /// Largest message of a client, bytes; a client that resumes sends an eighth of a byte for each node
    #[arg(long, default_value_t = 4 << 20, value_parser = clap::value_parser!(u32).range(1024..))]
    message: u32,
    /// Seconds after which a silent session ends
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    idle: u32,
    /// An origin whose pages may open sessions, beside this server's own, such as https://example.org; * is any. May be given more than once
    #[arg(long)]
    origin: Vec<String>,
    /// Lines of JSON on standard error instead of text
    #[arg(long)]
    json_log: bool,
}

pub fn run(args: Args, quiet: bool) -> Result<()> {
    if !args.folder.is_dir() {
        return Err(CliError::Usage(format!(
            "{}: there is no such folder; name the folder that the models are in",
            args.folder.display()
        )));
    }
    let level = if quiet { "warn" } else { "info" };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let log =
        tracing_subscriber::fmt().with_env_filter(filter).with_ansi(std::io::stderr().is_terminal()).with_writer(std::io::stderr);
    if args.json_log {
        log.json().init()
    } else {
        log.init()
    }
    let config = Config {
        folder: args.folder,
        bits: args.bits,
        sessions: args.sessions as usize,
        rate: args.rate,
        message: args.message as usize,
        idle: Duration::from_secs(args.idle.into()),
        origins: args.origin,
    };
    let failed = |e: std::io::Error| CliError::Other(format!("{}:{}: {e}", args.address, args.port));
    let runtime = tokio::runtime::Runtime::new().map_err(failed)?;
    runtime.block_on(async {
        let taken = |e: std::io::Error| match e.kind() {
            std::io::ErrorKind::AddrInUse => {
                CliError::Other(format!("{}:{}: something listens there already; --port names another", args.address, args.port))
            }
            _ => failed(e),
        };
        let listener = TcpListener::bind(SocketAddr::new(args.address, args.port)).await.map_err(taken)?;
        println!("http://{}", listener.local_addr().map_err(failed)?);
        pmesh_server::serve(config, listener, stop()).await.map_err(failed)
    })
}

/// Until someone wants it to end.
async fn stop() {
    #[cfg(unix)]
    {
        use tokio::signal::unix::{SignalKind, signal};
        if let Ok(mut term) = signal(SignalKind::terminate()) {
            tokio::select! {
                _ = tokio::signal::ctrl_c() => {}
                _ = term.recv() => {}
            }
            return;
        }
    }
    // Without a signal to wait for it goes on until it is killed.
    if tokio::signal::ctrl_c().await.is_err() {
        std::future::pending::<()>().await;
    }
}
