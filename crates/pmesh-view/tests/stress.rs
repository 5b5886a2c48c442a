//! Views and limits at random, answers late and in any order, both ways: it comes to rest, what is known is right, and who draws what has changed draws all of it.

mod common;

use common::of_sample;
use pmesh_core::hierarchy::{Front, NONE, Progress, UnderWay, View};
use pmesh_view::{BlockSizes, Client, FileClient, Limits, Model, Session, Viewer, write_file, write_file_of};
use std::sync::Arc;

struct Random(u64);
impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
    fn part(&mut self) -> f32 {
        self.below(1 << 20) as f32 / (1 << 20) as f32
    }
    fn view(&mut self, model: &Model) -> View {
        if self.below(30) == 0 {
            return View::everything();
        }
        let [low, high] = model.extent();
        let middle: [f32; 3] = std::array::from_fn(|k| (low[k] + high[k]) / 2.0);
        let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
        let (a, b, d) =
            (self.part() * std::f32::consts::TAU, self.part() * 3.0 - 1.5, size * (0.2 + 3.0 * self.part() * self.part()));
        let eye = [middle[0] + d * a.sin() * b.cos(), middle[1] + d * b.sin(), middle[2] + d * a.cos() * b.cos()];
        let target = middle.map(|x| x + (self.part() - 0.5) * size * 0.5);
        let camera = [0.2 + self.part() * 0.3, 1.5, 0.0005 + 0.006 * self.part()];
        View::look_at(eye, target, [0.01, 1.0, 0.02], camera).expect("a view")
    }
}

/// A client with the other end of its line.
enum Line {
    File { client: Box<FileClient>, file: Vec<u8>, asked: Vec<(u64, u64)> },
    Session { client: Box<Client>, session: Option<Box<Session>>, model: Arc<Model> },
}

impl Line {
    fn viewer(&mut self) -> &mut Viewer {
        match self {
            Line::File { client, .. } => client.viewer_mut(),
            Line::Session { client, .. } => client.viewer_mut(),
        }
    }
    /// Some of what is asked for comes, or does not.
    fn talk(&mut self, random: &mut Random) {
        match self {
            Line::File { client, file, asked } => {
                asked.extend(std::iter::from_fn(|| client.poll()));
                while !asked.is_empty() && random.below(2) == 0 {
                    let (start, end) = asked.swap_remove(random.below(asked.len() as u64) as usize);
                    if random.below(10) == 0 {
                        client.failed(start);
                    } else {
                        client.receive(start, &file[start as usize..file.len().min(end as usize)]).expect("the file is good");
                    }
                }
            }
            Line::Session { client, session, model } => {
                if random.below(60) == 0 && session.take().is_some() {
                    client.reconnect();
                }
                while let Some(message) = client.poll() {
                    match session {
                        None => *session = Some(Box::new(Session::open(&message, |_| Some(model.clone())).expect("it opens"))),
                        Some(s) => assert!(s.receive(&message).expect("a request")),
                    }
                }
                while random.below(3) > 0 {
                    let Some(message) = session.as_mut().and_then(|s| s.work(200, 2_000)) else { break };
                    client.receive(&message).expect("a reply");
                }
            }
        }
    }
    fn frame(&mut self, view: &View) -> (Progress, UnderWay) {
        let progress = match self {
            Line::File { client, .. } => client.refine(view, 3_000),
            Line::Session { client, .. } => client.refine(view, 3_000),
        };
        (progress.expect("a hierarchy"), self.viewer().advance(view, 0.02, 50_000).expect("a hierarchy"))
    }
    fn is_waiting(&self) -> bool {
        match self {
            Line::File { client, asked, .. } => client.is_waiting() || !asked.is_empty(),
            Line::Session { client, .. } => client.is_waiting(),
        }
    }
}

/// What someone has drawn who takes what has changed.
#[derive(Default)]
struct Picture {
    vertices: Vec<[[f32; 3]; 2]>,
    triangles: Vec<Option<[u32; 3]>>,
}

impl Picture {
    fn take(&mut self, front: &mut Front) {
        for v in front.take_changed_vertices() {
            self.vertices.resize(self.vertices.len().max(v as usize + 1), Default::default());
            self.vertices[v as usize] = [front.drawn_positions()[v as usize], front.drawn_normals()[v as usize]];
        }
        let shown = |front: &Front, place: usize| front.mesh().shown().get(place).and_then(|&t| front.mesh().triangle(t));
        for place in front.take_changed_places() {
            self.triangles.resize(self.triangles.len().max(place as usize + 1), None);
            self.triangles[place as usize] = shown(front, place as usize);
        }
        for place in 0..front.mesh().shown().len() {
            let corners = shown(front, place).expect("it is shown");
            assert_eq!(self.triangles.get(place).copied().flatten(), Some(corners), "place {place}");
            for v in corners.map(|v| v as usize) {
                assert_eq!(self.vertices[v], [front.drawn_positions()[v], front.drawn_normals()[v]]);
            }
        }
    }
}

fn is_right(viewer: &Viewer, model: &Model) {
    let front = viewer.front();
    front.mesh().check_invariants();
    let h = model.hierarchy();
    for i in 0..front.known() as u32 {
        let known = front.node(i).expect("it is known");
        let all = h.find(front.id(i)).expect("it is there");
        assert_eq!((known.position, known.bounds), (h.position(all), h.nodes()[all as usize].bounds));
        if known.child != NONE {
            let cuts = h.nodes()[all as usize].cuts.map(|c| (c != NONE).then(|| h.id(c).expect("a leaf")));
            for (own, whole) in known.cuts.into_iter().zip(cuts) {
                // Whole, or as far as the client knows the way; what it forgot it may have learnt again without that.
                let ends = |c| front.find(c).and_then(|n| front.node(n)).is_some_and(|n| n.child == NONE);
                let is_end = |c| viewer.evictions() > 0 || ends(c);
                assert!(own == whole || own.zip(whole).is_some_and(|(o, w)| o.is_above(w) && is_end(o)), "{own:?} {whole:?}");
            }
        }
    }
}

fn walk(mut line: Line, model: &Model, seed: u64) {
    let mut random = Random(seed);
    let mut picture = Picture::default();
    for step in 0..25 {
        if random.below(3) == 0 {
            let memory = if random.below(4) == 0 { usize::MAX } else { 30_000 + random.below(600_000) as usize };
            let triangles = if random.below(2) == 0 { usize::MAX } else { 1 + random.below(8_000) as usize };
            line.viewer().set_limits(Limits { memory, triangles });
        }
        // A few looks on the way.
        for _ in 0..random.below(12) {
            let view = random.view(model);
            line.talk(&mut random);
            line.frame(&view);
        }
        let view = random.view(model);
        let mut quiet = 0;
        for frame in 0.. {
            line.talk(&mut random);
            let (progress, under_way) = line.frame(&view);
            let still = progress.splits + progress.collapses + under_way.moving + under_way.turning == 0;
            quiet = if still && !line.is_waiting() { quiet + progress.looked as usize + 1 } else { 0 };
            if quiet > 2 * line.viewer().front().len() + 50 {
                break;
            }
            assert!(frame < 10_000, "seed {seed}, step {step}: no rest, {progress:?} {under_way:?} {}", line.is_waiting());
            if random.below(5) == 0 {
                picture.take(line.viewer().front_mut());
            }
        }
        picture.take(line.viewer().front_mut());
        is_right(line.viewer(), model);
    }
    let viewer = line.viewer();
    println!("seed {seed}: {} splits, forgotten {} times", viewer.splits(), viewer.evictions());
}

#[test]
fn a_file_comes_to_rest_whatever_is_asked_and_whenever_it_comes() {
    let (usual, small) = (BlockSizes::default(), BlockSizes { first: 40, others: 16 });
    for (name, sizes, seeds) in [("part", usual, 0..2), ("marble", usual, 1..2), ("part", small, 0..1), ("globe", small, 0..1)] {
        let (_, model) = of_sample(name);
        let (file, _) = write_file_of(&model, sizes).expect("a hierarchy");
        for seed in seeds {
            walk(
                Line::File { client: Box::new(FileClient::default().draw()), file: file.clone(), asked: Vec::new() },
                &model,
                seed,
            );
        }
    }
}

#[test]
fn a_session_comes_to_rest_whatever_is_asked_and_whenever_it_breaks() {
    for (name, seeds) in [("part", 0..3), ("knot", 0..1), ("marble", 0..2)] {
        let (_, model) = of_sample(name);
        for seed in seeds {
            walk(Line::Session { client: Box::new(Client::new("m").draw()), session: None, model: model.clone() }, &model, seed);
        }
    }
}

#[test]
fn a_limit_that_is_lifted_lets_the_front_grow_again() {
    let (_, model) = of_sample("knot");
    let (file, _) = write_file(&model).expect("a hierarchy");
    let mut line = Line::File { client: Box::default(), file, asked: Vec::new() };
    let view = common::lap(&model, 4)[1];
    let mut random = Random(5);
    let mut triangles = |limit: usize| {
        line.viewer().set_limits(Limits { triangles: limit, ..Default::default() });
        for _ in 0..400 {
            line.talk(&mut random);
            line.frame(&view);
        }
        line.viewer().front().triangles()
    };
    let free = triangles(usize::MAX);
    let few = triangles(free / 4);
    assert!(few <= free / 4 + 20 && few * 8 > free, "{few} of {free}");
    assert_eq!(triangles(usize::MAX), free);
}
