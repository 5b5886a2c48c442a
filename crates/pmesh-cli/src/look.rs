//! `pmesh look`: what a camera sees of a model at a server, as a mesh.

use crate::error::{CliError, Result};
use crate::output;
use clap::Parser;
use pmesh_core::hierarchy::{View, ViewError};
use pmesh_core::{IndexedMesh, Vertices};
use pmesh_view::message::{Reply, Request, read_reply, request};
use pmesh_view::{Client, ProtocolError};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;
use thiserror::Error;
use tungstenite::{HandshakeError, Message, WebSocket};

/// Get what a camera sees of a model from `pmesh serve`, and write it: fine where it looks, coarse elsewhere.
///
/// Says how many splits came, and bytes. More --eye, with --at once or as often, are looked from one after the other; the mesh is that of the last.
#[derive(Parser)]
#[command(
    after_help = "Example, after `pmesh sample knot -o models/knot.pmesh` and `pmesh serve models`:\n  pmesh look ws://127.0.0.1:8080/knot --eye 0,0,8 -o seen.ply\n  pmesh look ws://127.0.0.1:8080/knot --all -o whole.ply\n  pmesh look ws://127.0.0.1:8080 --list"
)]
pub struct Args {
    /// The server and the model's name, which may lack its .pmesh: ws://HOST:PORT/NAME
    url: String,
    /// The mesh: .ply or .obj
    #[arg(short, long, required_unless_present = "list")]
    output: Option<PathBuf>,
    /// Print the names of the server's models, and no more
    #[arg(long)]
    list: bool,
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
    /// Seconds after which a silent server is given up
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    timeout: u32,
    /// How often to connect again if the server goes away in the middle
    #[arg(long, default_value_t = 5)]
    retries: u32,
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
    let bad = || CliError::Usage(format!("{}: a server's address is ws://HOST:PORT/NAME (wss:// is not spoken here)", args.url));
    if args.list {
        return list(args);
    }
    let output = args.output.clone().unwrap_or_default();
    if !output.extension().is_some_and(|e| e == "ply" || e == "obj") {
        return Err(CliError::Usage(format!("{}: write .ply or .obj", output.display())));
    }
    let (host, name) =
        args.url.strip_prefix("ws://").and_then(|u| u.split_once('/')).filter(|u| !u.1.is_empty()).ok_or_else(bad)?;
    let mut views = Vec::new();
    for (i, &eye) in args.eye.iter().enumerate() {
        let at = args.at[i.min(args.at.len() - 1)];
        let tangent = (args.angle.to_radians() / 2.0).tan();
        let view = View::look_at(eye, at, args.up, [tangent, args.aspect, args.pixels / 1000.0]);
        views.push(view.map_err(|e| match e {
            ViewError::BadMatrix => CliError::Usage("no such view: --eye is at --at, or --up along the look".into()),
            e => CliError::Usage(e.to_string()),
        })?);
    }
    if args.all {
        views.push(View::everything());
    }
    if views.is_empty() {
        return Err(CliError::Usage("from where? --eye x,y,z, or --all".into()));
    }
    // As a browser's address line has it.
    let mut client = Client::new(&crate::input::percent_decoded(name));
    let mut connection = connect(args, host)?;
    let mut lost = 0;
    for view in &views {
        let before = (client.splits(), client.bytes());
        while let Err(e) = settle(&mut client, &mut connection, view) {
            // What is here is kept; this server, or another behind the same address, goes on from there.
            let gone = matches!(e, Lost::Connection(_) | Lost::Protocol(ProtocolError::Closed(_)));
            if !gone || client.total() == 0 || lost >= args.retries {
                return Err(failed(&e));
            }
            lost += 1;
            eprintln!("warning: {}: {e}; connecting again", args.url);
            std::thread::sleep(Duration::from_secs(1));
            let again = connect(args, host);
            match again {
                Ok(c) => connection = c,
                Err(e) if lost >= args.retries => return Err(e),
                Err(_) => {}
            }
            client.reconnect();
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
        let _ = connection.send(Message::Binary(message.into()));
    }
    let _ = connection.close(None);
    output::write(&output, &shown(&client))
}

/// The catalogue.
fn list(args: &Args) -> Result<()> {
    let failed = |e: &dyn std::fmt::Display| CliError::Other(format!("{}: {e}", args.url));
    let rest = args.url.strip_prefix("ws://").unwrap_or_default();
    let host = rest.split('/').next().filter(|h| !h.is_empty()).ok_or_else(|| failed(&"a server's address is ws://HOST:PORT"))?;
    let mut connection = connect(args, host)?;
    connection.send(Message::Binary(request(&Request::Catalogue).into())).map_err(|e| failed(&e))?;
    loop {
        if let Message::Binary(bytes) = connection.read().map_err(|e| failed(&e))? {
            return match read_reply(&bytes).map_err(|e| failed(&e))? {
                Reply::Catalogue(names) => output::say(&names.join("\n")),
                Reply::Error(text) => Err(failed(&text)),
                _ => Err(failed(&"the server does not answer with its catalogue")),
            };
        }
    }
}

/// Why a view did not get all that it needs.
#[derive(Debug, Error)]
enum Lost {
    #[error("{0}")]
    Connection(#[from] tungstenite::Error),
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
}

fn connect(args: &Args, host: &str) -> Result<WebSocket<TcpStream>> {
    let failed = |e: &dyn std::fmt::Display| CliError::Other(format!("{}: {e}", args.url));
    let address = if host.contains(':') { host.to_string() } else { format!("{host}:80") };
    let stream = TcpStream::connect(&address).map_err(|e| failed(&e))?;
    stream.set_read_timeout(Some(Duration::from_secs(args.timeout.into()))).map_err(|e| failed(&e))?;
    match tungstenite::client(format!("ws://{host}/"), stream) {
        Ok((socket, _)) => Ok(socket),
        // The server says why.
        Err(HandshakeError::Failure(tungstenite::Error::Http(answer))) => {
            let body = answer.body().as_deref().map(String::from_utf8_lossy).unwrap_or_default();
            Err(failed(&format!("{} {}", answer.status(), body.trim())))
        }
        Err(e) => Err(failed(&e)),
    }
}

/// Nodes that are looked at for each message.
const LOOKS: u32 = 1 << 14;

/// Asks and refines until the view has all that it needs.
fn settle(client: &mut Client, socket: &mut WebSocket<TcpStream>, view: &View) -> std::result::Result<(), Lost> {
    loop {
        // All of the front is looked through once nothing is on its way any more: for each packet that would take ever longer.
        let budget = if client.is_waiting() { LOOKS } else { u32::MAX };
        let progress = client.refine(view, budget)?;
        while let Some(message) = client.poll() {
            socket.send(Message::Binary(message.into()))?;
        }
        if client.is_waiting() {
            if let Message::Binary(bytes) = socket.read()? {
                client.receive(&bytes)?;
            }
        } else if progress.splits + progress.collapses == 0 {
            return Ok(());
        }
    }
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
