//! KL04's experiments: `cargo bench -p pmesh-view --bench view -- MODEL [--json FILE] [--plots FOLDER]`, which is what `cargo xtask bench view-dependent` runs.
#![allow(missing_docs)]
// Times are what this is for.
#![allow(clippy::disallowed_methods)]

use pmesh_build::compact::take_apart;
use pmesh_build::hierarchy::hierarchy;
use pmesh_build::import::import;
use pmesh_build::simplify::BatchOptions;
use pmesh_codec::Receiver;
use pmesh_codec::compact;
use pmesh_codec::pmesh::{Quantisation, quantise};
use pmesh_core::hierarchy::{Bounds, NONE, View};
use pmesh_core::{IndexedMesh, Vertices};
use pmesh_view::{Client, FileClient, Model, Session, write_file};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

const BITS: u8 = 12;
/// Half the angle of view's tangent, width ÷ height, pixels of the viewport's height.
const CAMERA: [f32; 3] = [0.4, 1.5, 1000.0];
/// Steps of the path.
const STEPS: u32 = 240;
/// KL04's packets, derived in SEEDS E.9: a split with what views need, and without.
const PAPER_SPLIT: [f64; 2] = [78.0, 24.0];

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Lets both ends talk until the view has all that it needs; gives the seconds that each took.
fn settle(client: &mut Client, session: &mut Option<Session>, model: &Arc<Model>, view: &View) -> Outcome<[f64; 2]> {
    let mut seconds = [0.0; 2];
    loop {
        let start = Instant::now();
        let progress = client.refine(view, u32::MAX)?;
        let mut sent = false;
        let messages: Vec<_> = std::iter::from_fn(|| client.poll()).collect();
        seconds[0] += start.elapsed().as_secs_f64();
        for message in messages {
            sent = true;
            match session {
                None => *session = Some(Session::open(&message, |_| Some(model.clone()))?),
                Some(s) => drop(s.receive(&message)?),
            }
        }
        loop {
            let start = Instant::now();
            let message = session.as_mut().and_then(|s| s.work(2_000, u32::MAX));
            seconds[1] += start.elapsed().as_secs_f64();
            let Some(message) = message else { break };
            let start = Instant::now();
            client.receive(&message)?;
            seconds[0] += start.elapsed().as_secs_f64();
            sent = true;
        }
        if !sent && progress.splits + progress.collapses == 0 {
            return Ok(seconds);
        }
    }
}

/// The same from a file, by ranges.
fn settle_file(client: &mut FileClient, file: &[u8], view: &View) -> Outcome<()> {
    loop {
        while let Some((start, end)) = client.poll() {
            client.receive(start, &file[start as usize..file.len().min(end as usize)])?;
        }
        let progress = client.refine(view, u32::MAX)?;
        if progress.splits + progress.collapses == 0 && !client.is_waiting() && !progress.wants_more {
            return Ok(());
        }
    }
}

/// Away and near again while going about: the path of a lap.
fn path(low: [f32; 3], high: [f32; 3], tolerance: f32) -> Outcome<Vec<View>> {
    let centre = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
    let at = |i: u32| {
        let a = i as f32 / STEPS as f32 * std::f32::consts::TAU;
        let d = size * (1.5 + 0.9 * (2.0 * a).cos());
        let eye = [centre[0] + d * a.sin(), centre[1] + 0.2 * size * a.cos(), centre[2] + d * a.cos()];
        View::look_at(eye, centre, [0.0, 1.0, 0.0], [CAMERA[0], CAMERA[1], tolerance]).map_err(Into::into)
    };
    (0..STEPS).map(at).collect()
}

/// Splits and collapses a second of a client that knows everything: to the base mesh and back.
fn steps_of_all(client: &mut Client) -> Outcome<f64> {
    let everything = View::everything();
    let far = View::look_at([0.0, 0.0, 1e6], [0.0; 3], [0.0, 1.0, 0.0], CAMERA.map(|x| x.min(1.0)))?;
    let (start, mut steps) = (Instant::now(), 0);
    for view in [far, everything, far, everything] {
        loop {
            let p = client.refine(&view, u32::MAX)?;
            steps += u64::from(p.splits + p.collapses);
            if p.splits + p.collapses == 0 {
                break;
            }
        }
    }
    Ok(steps as f64 / start.elapsed().as_secs_f64())
}

/// Splits that a stream without views needs for an error of `length` anywhere.
fn everywhere(model: &Model, length: f64) -> usize {
    let h = model.hierarchy();
    let worst = |b: &Bounds| Bounds::length(b.uniform, h.unit()).max(Bounds::length(b.directional, h.unit()));
    h.nodes().iter().filter(|n| n.child != NONE && worst(&n.bounds) >= length).count()
}

/// Bytes of a `.pmesh` until it has so many vertices.
fn bytes_of(file: &[u8], vertices: usize) -> Outcome<usize> {
    let mut receiver = Receiver::default();
    let mut bytes = 0;
    for part in file.chunks(file.len() / 200 + 1) {
        receiver.push(part)?;
        bytes += part.len();
        if receiver.newest_mesh().vertices.len() >= vertices {
            break;
        }
    }
    Ok(bytes)
}

fn run(mesh: &IndexedMesh, name: &str, plots: Option<&Path>) -> Outcome<serde_json::Value> {
    let start = Instant::now();
    let grid = Quantisation::fit(&mesh.vertices, Some(BITS));
    let mesh = quantise(mesh, Some(BITS));
    let stream = take_apart(mesh.clone(), Some(BITS), BatchOptions::default(), |_| ())?;
    let taken = start.elapsed().as_secs_f64();
    let hierarchy = hierarchy(&mesh, &stream)?;
    let model = Arc::new(Model::new(hierarchy, &mesh.triangles, grid)?);
    let mut file = Vec::new();
    compact::encode(&stream, Some(BITS), &mut file)?;
    let h = model.hierarchy();
    let (roots, nodes) = (h.root_count() as usize, h.nodes().len());
    let bits = h.id_bits();
    println!(
        "{name}: {} vertices, {} triangles; {roots} base vertices, {} details; names of <{}, {}> bits",
        mesh.vertices.len(),
        mesh.triangles.len(),
        (nodes - roots) / 2,
        bits.tree,
        bits.node
    );
    println!(
        "  taken apart in {taken:.1} s, the hierarchy {:.1} s; {} bytes as .pmesh",
        start.elapsed().as_secs_f64() - taken,
        file.len()
    );
    let tolerance = 1.0 / CAMERA[2];
    let (low, high) = mesh.bounds();
    let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);

    // Fixed views (Figure 8): of all, of the uppermost part, of a piece of that.
    let middle = [(low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, high[2]];
    let above = [middle[0], high[1] - 0.12 * (high[1] - low[1]), high[2]];
    let start = Instant::now();
    let (packed, _) = write_file(&model)?;
    let seconds = start.elapsed().as_secs_f64();
    let (mut client, mut session) = (Client::new(name), None);
    settle(&mut client, &mut session, &model, &View::everything())?;
    let whole = client.bytes().1;
    let overhead = packed.len() as f64 / whole as f64 - 1.0;
    let rate_of_all = steps_of_all(&mut client)?;
    println!(
        "  as a file of blocks {} bytes, packed in {seconds:.1} s: {:.1} % more than a session of all of it ({whole}), {:.2} x the .pmesh without views",
        packed.len(),
        100.0 * overhead,
        packed.len() as f64 / file.len() as f64
    );
    let mut fixed = Vec::new();
    for (what, target, far) in [("whole", middle, 1.6), ("near", above, 0.45), ("close", above, 0.12)] {
        let distance = far * size;
        let eye = [target[0], target[1], target[2] + distance];
        let view = View::look_at(eye, target, [0.0, 1.0, 0.0], [CAMERA[0], CAMERA[1], tolerance])?;
        let (mut client, mut session) = (Client::new(name), None);
        settle(&mut client, &mut session, &model, &view)?;
        let (up, down) = client.bytes();
        let splits = client.splits() as f64;
        let all = everywhere(&model, f64::from(2.0 * tolerance * CAMERA[0] * distance));
        let plain = bytes_of(&file, roots + all)?;
        let base = model.base().len() as f64;
        println!(
            "  {what} view, a pixel of {}: {splits} splits, {} faces; up {up}, down {down} bytes, {:.2} a split",
            CAMERA[2],
            client.front().mesh().shown().len(),
            (down as f64 - base) / splits.max(1.0)
        );
        println!(
            "    without views {all} splits: {plain} bytes of .pmesh, {:.2} x; by the paper's packets {:.2} x (the paper, one view: 4.67 x)",
            plain as f64 / down as f64,
            all as f64 * PAPER_SPLIT[1] / (splits * PAPER_SPLIT[0])
        );
        let mut blocks = FileClient::default();
        settle_file(&mut blocks, &packed, &view)?;
        let (requests, fetched) = blocks.traffic();
        println!(
            "    from the file: {requests} requests, {fetched} bytes, {:.2} x a session's; {:.2} x without views",
            fetched as f64 / down as f64,
            plain as f64 / fetched as f64
        );
        fixed.push(json!({ "view": what, "file_requests": requests, "file_bytes": fetched, "splits": splits, "faces": client.front().mesh().shown().len(), "bytes_up": up, "bytes_down": down, "splits_without_views": all,
            "bytes_without_views": plain, "bytes_ratio": plain as f64 / down as f64, "bytes_ratio_of_papers_packets": all as f64 * PAPER_SPLIT[1] / (splits * PAPER_SPLIT[0]),
            "bytes_per_split": (down as f64 - base) / splits.max(1.0) }));
    }

    // Two laps (Figures 6 and 7).
    let (mut client, mut session) = (Client::new(name), None);
    let mut curve = Vec::new();
    let mut laps = [(0, 0); 2];
    let (mut worst, mut tags_ratio, mut front_most) = ([0.0f64; 2], 0.0f64, 0u64);
    for lap in &mut laps {
        let before = client.bytes();
        for view in path(low, high, tolerance)? {
            let seconds = settle(&mut client, &mut session, &model, &view)?;
            let tags = session.as_ref().map_or(0, |s| s.tags().memory_bytes());
            let front = session.as_ref().map_or(0, |s| s.tags().len());
            tags_ratio = tags_ratio.max(tags as f64 / (16.0 * front as f64));
            front_most = front_most.max(front);
            worst = [worst[0].max(seconds[0]), worst[1].max(seconds[1])];
            curve.push((client.bytes(), client.front().mesh().shown().len(), seconds));
        }
        let now = client.bytes();
        *lap = (now.0 - before.0, now.1 - before.1);
    }
    let splits = client.splits();
    let per_split = (laps[0].1 as f64 - model.base().len() as f64) / splits as f64;
    println!(
        "  a lap of {STEPS} views: up {} bytes, down {} for {splits} splits, {per_split:.2} each (paper: some 78); the second lap: up {}, down {} (paper: 0)",
        laps[0].0, laps[0].1, laps[1].0, laps[1].1
    );
    let spent = session.as_ref().map(Session::spent).unwrap_or_default();
    let each = |bits: f64| bits / 8.0 / splits as f64;
    println!(
        "    of these {:.2} say which split, {:.2} where, {:.2} the cuts, {:.2} the bounds",
        each(spent.names),
        each(spent.positions),
        each(spent.cuts),
        each(spent.bounds)
    );
    let memory = session.as_ref().map_or(0, Session::memory_bytes);
    println!(
        "  the server's front: at most {front_most} nodes, its tags {:.1} % of a list of 16 bytes a node (paper: under 10 %); {memory} bytes a session",
        100.0 * tags_ratio
    );
    let settled = |side: usize| curve[STEPS as usize..].iter().map(|c| c.2[side]).fold(0.0, f64::max);
    println!(
        "  seconds a view: client {:.4} at most, {:.4} on the second lap; server {:.4}, {:.4}",
        worst[0],
        settled(0),
        worst[1],
        settled(1)
    );

    // Splits and collapses a second: between the two views, all being here.
    let start = Instant::now();
    let mut steps = 0;
    let views = path(low, high, tolerance)?;
    for _ in 0..5 {
        for view in [views[0], views[STEPS as usize / 4]] {
            loop {
                let p = client.refine(&view, u32::MAX)?;
                steps += u64::from(p.splits + p.collapses);
                if p.splits + p.collapses == 0 {
                    break;
                }
            }
        }
    }
    let rate = steps as f64 / start.elapsed().as_secs_f64();
    println!(
        "  {:.2} M splits and collapses a second from view to view, looks at the front included; {:.2} M of all that there is, down to the base and up again",
        rate / 1e6,
        rate_of_all / 1e6
    );
    if let Some(folder) = plots {
        plot(&folder.join(format!("{name}-view-bytes.svg")), "bytes down", curve.iter().map(|c| c.0.1 as f64).collect())?;
        plot(&folder.join(format!("{name}-view-faces.svg")), "faces", curve.iter().map(|c| c.1 as f64).collect())?;
    }
    Ok(json!({
        "model": name, "vertices": mesh.vertices.len(), "base_vertices": roots, "id_bits": [bits.tree, bits.node], "pmesh_bytes": file.len(),
        "fixed": fixed, "bytes_ratio": fixed[2]["bytes_ratio"], "lap_bytes_up": laps[0].0, "lap_bytes_down": laps[0].1,
        "second_lap_bytes": laps[1].0 + laps[1].1, "tags_over_front": tags_ratio, "front": front_most, "session_bytes": memory, "splits": splits,
        "bytes_per_split": per_split, "steps_a_second": rate, "steps_a_second_of_all": rate_of_all,
        "file_bytes": packed.len(), "file_overhead": overhead, "file_over_pmesh": packed.len() as f64 / file.len() as f64,
    }))
}

/// A curve over the frames of both laps.
fn plot(path: &Path, what: &str, values: Vec<f64>) -> Outcome<()> {
    let most = values.iter().copied().fold(1.0, f64::max);
    let point =
        |(i, v): (usize, &f64)| format!("{:.1},{:.1}", 60.0 + 620.0 * i as f64 / values.len() as f64, 360.0 - 320.0 * v / most);
    let line: Vec<String> = values.iter().enumerate().map(point).collect();
    let svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 720 400' font-family='sans-serif' font-size='13'><rect width='720' height='400' fill='#fff'/><path d='M60 30V360H690' fill='none' stroke='#888'/>\
         <polyline points='{}' fill='none' stroke='#06c' stroke-width='2'/><text x='64' y='26'>{what}, at most {most}</text><text x='300' y='386'>views, two laps</text></svg>",
        line.join(" ")
    );
    std::fs::write(path, svg).map_err(Into::into)
}

fn main() -> Outcome<()> {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let (mut meshes, mut json_to, mut plots) = (Vec::new(), None, None);
    while let Some(arg) = args.next() {
        match &arg[..] {
            "--json" => json_to = args.next().map(PathBuf::from),
            "--plots" => plots = args.next().map(PathBuf::from),
            _ => meshes.push(PathBuf::from(arg)),
        }
    }
    if meshes.is_empty() {
        println!("no mesh: cargo bench -p pmesh-view --bench view -- MESH… [--json FILE] [--plots FOLDER]");
    }
    let mut all = Vec::new();
    for path in meshes {
        let mesh = import(&path.to_string_lossy(), &std::fs::read(&path)?, &mut |_| None)?.mesh;
        let vertices = Vertices { positions: mesh.vertices.positions, ..Default::default() };
        let plain = IndexedMesh { vertices, triangles: mesh.triangles, ..Default::default() };
        let name = path.file_stem().map_or("model".into(), |s| s.to_string_lossy().into_owned());
        all.push(run(&plain, &name, plots.as_deref())?);
    }
    if let Some(path) = json_to {
        std::fs::write(path, serde_json::to_string_pretty(&if all.len() == 1 { all.remove(0) } else { all.into() })?)?;
    }
    Ok(())
}
