//! Many clients at one server: `cargo bench -p pmesh-server --bench load -- MODEL.pmesh [CLIENTS] [SECONDS]`.
//!
//! Each client goes about the model on a way of its own, and says twice a second what it sees; it reads all that comes, and decodes none of it. Server and clients share the machine. Prints how long a view
//! took until the server was done with it, and what the process takes before and after.
#![allow(missing_docs)]
// Times are what this is for.
#![allow(clippy::disallowed_methods)]

use futures_util::{SinkExt, StreamExt};
use pmesh_core::hierarchy::View;
use pmesh_server::{Config, serve};
use pmesh_view::message::{Reply, Request, read_reply, request};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::time::{interval, timeout};
use tokio_tungstenite::connect_async;
use tokio_tungstenite::tungstenite::Message;

type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// Resident memory of this process, MB; where the system does not tell, nothing.
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

/// One client; gives the seconds that each view took, and the bytes that came.
async fn client(url: String, name: String, number: u32, seconds: u64) -> Outcome<(Vec<f64>, u64)> {
    let (mut socket, _) = connect_async(url).await?;
    socket.send(Message::Binary(request(&Request::Hello { model: name, packets: Default::default() }).into())).await?;
    let (mut taken, mut bytes) = (Vec::new(), 0u64);
    let mut box_of = None;
    while box_of.is_none() {
        let Some(message) = socket.next().await else { return Err("the server is gone".into()) };
        if let Message::Binary(m) = message? {
            bytes += m.len() as u64;
            match read_reply(&m)? {
                Reply::Base(base) => {
                    let bound =
                        |f: fn(f32, f32) -> f32, from| [0, 1, 2].map(|k| base.positions.iter().map(|p| p[k]).fold(from, f));
                    box_of = Some((bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY)));
                }
                Reply::Error(why) => return Err(why.into()),
                _ => {}
            }
        }
    }
    let Some((low, high)) = box_of else { return Err("no base mesh".into()) };
    let centre = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
    let mut ticks = interval(Duration::from_millis(500));
    for step in 0..2 * seconds {
        ticks.tick().await;
        let a = 0.4 * step as f32 + number as f32;
        let d = size * (1.3 + 0.8 * (0.3 * a).cos());
        let eye = [centre[0] + d * a.sin(), centre[1] + 0.3 * size, centre[2] + d * a.cos()];
        let view = View::look_at(eye, centre, [0.0, 1.0, 0.0], [0.4, 1.5, 0.002])?;
        let start = Instant::now();
        socket.send(Message::Binary(request(&Request::View(Box::new(view))).into())).await?;
        loop {
            let Some(message) = timeout(Duration::from_secs(60), socket.next()).await? else {
                return Err("the server is gone".into());
            };
            let Message::Binary(m) = message? else { continue };
            bytes += m.len() as u64;
            match read_reply(&m)? {
                Reply::Done => break,
                Reply::Error(why) => return Err(why.into()),
                _ => {}
            }
        }
        taken.push(start.elapsed().as_secs_f64());
    }
    socket.send(Message::Binary(request(&Request::Bye).into())).await?;
    Ok((taken, bytes))
}

async fn run(model: PathBuf, clients: u32, seconds: u64) -> Outcome<()> {
    let folder = std::path::absolute(&model)?.parent().map(Into::into).ok_or("a file in a folder")?;
    let name = model.file_name().map(|n| n.to_string_lossy().into_owned()).ok_or("a file")?;
    let config = Config {
        folder,
        bits: 12,
        sessions: clients as usize,
        rate: None,
        message: 1 << 20,
        idle: Duration::from_secs(60),
        origins: Vec::new(),
    };
    let listener = TcpListener::bind("127.0.0.1:0").await?;
    let url = format!("ws://{}/", listener.local_addr()?);
    let server = tokio::spawn(serve(config, listener, std::future::pending()));
    // The first waits for the model.
    let start = Instant::now();
    client(url.clone(), name.clone(), 0, 0).await?;
    println!("{name}: ready after {:.1} s; {:.0} MB", start.elapsed().as_secs_f64(), resident().unwrap_or(0.0));
    let before = resident();
    let all: Vec<_> = (0..clients).map(|i| tokio::spawn(client(url.clone(), name.clone(), i, seconds))).collect();
    tokio::time::sleep(Duration::from_millis(1000 * seconds * 9 / 10)).await;
    let after = resident();
    let (mut taken, mut bytes, mut failed) = (Vec::new(), 0, 0);
    for one in all {
        match one.await? {
            Ok((t, b)) => {
                taken.extend(t);
                bytes += b;
            }
            Err(e) => {
                failed += 1;
                if failed == 1 {
                    println!("a client failed: {e}");
                }
            }
        }
    }
    taken.sort_by(f64::total_cmp);
    let at = |part: f64| taken.get(((taken.len() as f64 - 1.0) * part) as usize).map_or(0.0, |t| 1000.0 * t);
    println!(
        "{clients} clients, two views a second each for {seconds} s: {} views, {failed} clients failed, {:.1} MB down",
        taken.len(),
        bytes as f64 / 1e6
    );
    println!(
        "milliseconds until the server was done with a view: median {:.1}, 90 % {:.1}, 99 % {:.1}, most {:.1}",
        at(0.5),
        at(0.9),
        at(0.99),
        at(1.0)
    );
    if let (Some(before), Some(after)) = (before, after) {
        println!("memory: {:.0} kB more a client, both ends in one process", 1024.0 * (after - before) / f64::from(clients));
    }
    server.abort();
    Ok(())
}

fn main() -> Outcome<()> {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let Some(model) = args.next() else {
        println!("no model: cargo bench -p pmesh-server --bench load -- MODEL.pmesh [CLIENTS] [SECONDS]");
        return Ok(());
    };
    let number = |text: Option<String>, otherwise: u64| text.map_or(Ok(otherwise), |t| t.parse());
    let (clients, seconds) = (number(args.next(), 500)?, number(args.next(), 10)?);
    tokio::runtime::Runtime::new()?.block_on(run(model.into(), u32::try_from(clients)?, seconds))
}
