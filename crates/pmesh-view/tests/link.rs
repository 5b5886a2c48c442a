//! A client and servers over a link with a clock of its own: latency, bandwidth, loss of the connection (E.7, E.17).

mod common;

use common::{lap, of_sample, shown};
use pmesh_core::hierarchy::View;
use pmesh_view::{Client, Model, Session};
use std::collections::VecDeque;
use std::sync::Arc;

/// Seconds a tick of the clock.
const TICK: f64 = 0.01;

/// One direction: messages arrive in order, after the latency and what the bandwidth makes of their length.
#[derive(Default)]
struct Pipe {
    latency: f64,
    bytes_a_second: f64,
    free_at: f64,
    messages: VecDeque<(f64, Vec<u8>)>,
}

impl Pipe {
    fn send(&mut self, now: f64, message: Vec<u8>) {
        self.free_at = self.free_at.max(now) + message.len() as f64 / self.bytes_a_second;
        self.messages.push_back((self.free_at + self.latency, message));
    }
    fn receive(&mut self, now: f64) -> Option<Vec<u8>> {
        if self.messages.front()?.0 <= now { self.messages.pop_front().map(|m| m.1) } else { None }
    }
    /// What a sender sees of it: there is no use in more.
    fn is_full(&self, now: f64) -> bool {
        self.free_at > now + 0.1
    }
}

struct World {
    now: f64,
    model: Arc<Model>,
    client: Client,
    session: Option<Session>,
    up: Pipe,
    down: Pipe,
    /// Splits of sessions that are over.
    sent: u64,
}

impl World {
    fn new(model: &Arc<Model>, latency: f64, bytes_a_second: f64) -> Self {
        let pipe = || Pipe { latency, bytes_a_second, ..Default::default() };
        let client = Client::new("m");
        Self { now: 0.0, model: model.clone(), client, session: None, up: pipe(), down: pipe(), sent: 0 }
    }
    /// A tick in which the client looks at a view; true if nothing happens any more.
    fn tick(&mut self, view: &View) -> bool {
        self.now += TICK;
        while let Some(message) = self.up.receive(self.now) {
            match &mut self.session {
                None => self.session = Some(Session::open(&message, |_| Some(self.model.clone())).expect("it opens")),
                Some(s) => assert!(s.receive(&message).expect("a request")),
            }
        }
        while !self.down.is_full(self.now) {
            let Some(message) = self.session.as_mut().and_then(|s| s.work(100, 5_000)) else { break };
            self.down.send(self.now, message);
        }
        while let Some(message) = self.down.receive(self.now) {
            self.client.receive(&message).expect("a reply");
        }
        let progress = self.client.refine(view, 20_000).expect("a hierarchy");
        while let Some(message) = self.client.poll() {
            self.up.send(self.now, message);
        }
        progress.splits + progress.collapses == 0 && !self.client.is_waiting() && !self.client.viewer().is_empty()
    }
    /// Until nothing happens; gives the seconds.
    fn settle(&mut self, view: &View) -> f64 {
        let start = self.now;
        while !self.tick(view) {
            assert!(self.now < start + 600.0, "it takes for ever");
        }
        self.now - start
    }
    /// The connection breaks: what is under way is gone, and the next server has never heard of the client.
    fn cut(&mut self) {
        self.up.messages.clear();
        self.down.messages.clear();
        (self.up.free_at, self.down.free_at) = (self.now, self.now);
        self.sent += self.session.take().map_or(0, |s| s.counts().splits);
        self.client.reconnect();
    }
}

#[test]
fn a_view_takes_two_round_trips_and_what_its_bytes_take() {
    let (_, model) = of_sample("marble");
    let view = lap(&model, 4)[0];
    let mut ideal = World::new(&model, 0.0, f64::INFINITY);
    ideal.settle(&view);
    let bytes = ideal.client.bytes().1 as f64;
    for (latency, rate) in [(0.05, 1e6), (0.3, 1e6), (0.05, 20_000.0), (0.5, 10_000.0)] {
        let mut world = World::new(&model, latency, rate);
        let seconds = world.settle(&view);
        // Hello and base, view and splits: there and back twice.
        let least = 4.0 * latency + bytes / rate;
        println!("{latency} s there, {rate} bytes/s: {seconds:.2} s, at least {least:.2}");
        assert!(seconds >= least * 0.98 && seconds < least + 0.3 + 20.0 * TICK);
        assert_eq!(shown(&world.client), shown(&ideal.client));
    }
}

#[test]
fn who_looks_elsewhere_does_not_wait_for_what_was_asked_for_before() {
    let (_, model) = of_sample("marble");
    let views = lap(&model, 8);
    let mut world = World::new(&model, 0.1, 15_000.0);
    // Half a second each, on a link that takes several for one.
    for view in &views[..6] {
        let until = world.now + 0.5;
        while world.now < until {
            world.tick(view);
        }
    }
    let seconds = world.settle(&views[6]);
    let mut straight = World::new(&model, 0.1, 15_000.0);
    let alone = straight.settle(&views[6]);
    println!("{seconds:.2} s after looking about, {alone:.2} s at once");
    assert!(seconds < alone + 0.5);
    world.client.front().mesh().check_invariants();
}

#[test]
fn e7_a_link_that_breaks_every_second_loses_nothing_but_what_was_under_way() {
    let (_, model) = of_sample("marble");
    let view = lap(&model, 4)[0];
    let mut ideal = World::new(&model, 0.0, f64::INFINITY);
    ideal.settle(&view);
    let mut world = World::new(&model, 0.1, 5_000.0);
    let mut breaks = 0;
    let mut next = 1.0;
    while !world.tick(&view) {
        assert!(breaks < 100);
        if world.now > next {
            world.cut();
            (breaks, next) = (breaks + 1, world.now + 1.0);
        }
    }
    let sent = world.sent + world.session.as_ref().map_or(0, |s| s.counts().splits);
    println!("{breaks} breaks: {} splits, {sent} sent", world.client.splits());
    assert!(breaks > 2);
    assert_eq!(shown(&world.client), shown(&ideal.client));
    assert_eq!(world.client.splits(), ideal.client.splits(), "none twice");
    // At most what fits the pipe: a fifth of a second's bytes, two and a half of which are a split here, and a packet.
    assert!(sent - world.client.splits() < breaks * (5_000 / 5 * 2 / 5 + 100));
}
