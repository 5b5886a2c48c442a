//! `pmesh look`: what a camera sees of a model at a server, as a mesh.

use crate::error::{CliError, Result};
use crate::output;
use clap::Parser;
use pmesh_core::hierarchy::View;
use pmesh_core::{IndexedMesh, Vertices};
use pmesh_view::Client;
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;
use tungstenite::Message;

/// Get what a camera sees of a model from `pmesh serve`, and write it: fine where it looks, coarse elsewhere.
///
/// Says how many splits came, and bytes. More --eye, with --at once or as often, are looked from one after the other; the mesh is that of the last.
#[derive(Parser)]
#[command(
    after_help = "Example, after `pmesh sample knot -o models/knot.pmesh` and `pmesh serve models`:\n  pmesh look ws://127.0.0.1:8080/knot --eye 0,0,8 -o seen.ply\n  pmesh look ws://127.0.0.1:8080/knot --all -o whole.ply"
)]
pub struct Args {
    /// The server and the model's name, which may lack its .pmesh: ws://HOST:PORT/NAME
    url: String,
    /// The mesh: .ply or .obj
    #[arg(short, long)]
    output: PathBuf,
    /// Where the camera is: x,y,z
    #[arg(long, value_parser = point, allow_hyphen_values = true)]
    eye: Vec<[f32; 3]>,
    /// What it looks at
    #[arg(long, value_parser = point, allow_hyphen_values = true, default_value = "0,0,0")]
    at: Vec<[f32; 3]>,
    /// Which way is up
    #[arg(long, value_parser = point, allow_hyphen_values = true, default_value = "0,1,0")]
    up: [f32; 3],
    /// Vertical angle of view, degrees
    #[arg(long, default_value_t = 43.6)]
    angle: f32,
    /// Width ÷ height of the picture
    #[arg(long, default_value_t = 1.5)]
    aspect: f32,
    /// Error allowed, pixels of a picture 1,000 high
    #[arg(long, default_value_t = 1.0)]
    pixels: f32,
    /// Everything, whatever is seen
    #[arg(long, conflicts_with = "eye")]
    all: bool,
}

fn point(text: &str) -> std::result::Result<[f32; 3], String> {
    let numbers: Vec<f32> = text.split(',').map_while(|x| x.trim().parse().ok()).collect();
    <[f32; 3]>::try_from(numbers).ok().filter(|_| text.split(',').count() == 3).ok_or_else(|| "three numbers, as 0,1.5,-2".into())
}

pub fn run(args: &Args, quiet: bool) -> Result<()> {
    let failed = |e: &dyn std::fmt::Display| CliError::Other(format!("{}: {e}", args.url));
    let bad = || CliError::Usage(format!("{}: a server's address is ws://HOST:PORT/NAME", args.url));
    let (host, name) =
        args.url.strip_prefix("ws://").and_then(|u| u.split_once('/')).filter(|u| !u.1.is_empty()).ok_or_else(bad)?;
    let mut views = Vec::new();
    for (i, &eye) in args.eye.iter().enumerate() {
        let at = args.at[i.min(args.at.len() - 1)];
        let tangent = (args.angle.to_radians() / 2.0).tan();
        let view = View::look_at(eye, at, args.up, [tangent, args.aspect, args.pixels / 1000.0]);
        views.push(view.map_err(|e| CliError::Usage(format!("{e} (is --eye at --at, or --up along the look?)")))?);
    }
    if args.all {
        views.push(View::everything());
    }
    if views.is_empty() {
        return Err(CliError::Usage("from where? --eye x,y,z, or --all".into()));
    }
    let address = if host.contains(':') { host.to_string() } else { format!("{host}:80") };
    let stream = TcpStream::connect(&address).map_err(|e| failed(&e))?;
    stream.set_read_timeout(Some(Duration::from_secs(120))).map_err(|e| failed(&e))?;
    let (mut socket, _) = tungstenite::client(&args.url, stream).map_err(|e| failed(&e))?;
    let mut client = Client::new(name);
    for view in &views {
        let before = (client.splits(), client.bytes());
        loop {
            let progress = client.refine(view, u32::MAX).map_err(|e| failed(&e))?;
            while let Some(message) = client.poll() {
                socket.send(Message::Binary(message.into())).map_err(|e| failed(&e))?;
            }
            if client.is_waiting() {
                if let Message::Binary(bytes) = socket.read().map_err(|e| failed(&e))? {
                    client.receive(&bytes).map_err(|e| failed(&e))?;
                }
            } else if progress.splits + progress.collapses == 0 {
                break;
            }
        }
        if !quiet {
            let (up, down) = client.bytes();
            output::say(&format!(
                "{} splits, {} bytes up, {} down; {} triangles shown, {} of {} nodes known",
                client.splits() - before.0,
                up - before.1.0,
                down - before.1.1,
                client.front().mesh().shown().len(),
                client.front().known(),
                client.total()
            ))?;
        }
    }
    client.close();
    // Both may fail: all is here.
    if let Some(message) = client.poll() {
        let _ = socket.send(Message::Binary(message.into()));
    }
    let _ = socket.close(None);
    output::write(&args.output, &shown(&client))
}

/// The front's triangles, and the vertices that these use.
fn shown(client: &Client) -> IndexedMesh {
    let front = client.front();
    let mut number = vec![u32::MAX; front.positions().len()];
    let mut mesh = IndexedMesh { vertices: Vertices::default(), ..Default::default() };
    for t in front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)) {
        let corners = t.map(|v| {
            let n = &mut number[v as usize];
            if *n == u32::MAX {
                *n = mesh.vertices.positions.len() as u32;
                mesh.vertices.positions.push(front.positions()[v as usize]);
            }
            *n
        });
        mesh.triangles.push(corners);
    }
    mesh
}
