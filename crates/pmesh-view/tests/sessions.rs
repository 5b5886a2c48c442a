//! A client and servers over a simulated link: G.20, G.22, G.24, G.25.

mod common;

use common::{BITS, lap, model_of, of, part, plain, shown};
use pmesh_build::sample::{knot, sample};
use pmesh_codec::pmesh::quantise;
use pmesh_core::hierarchy::View;
use pmesh_view::message::{self, Packets, Request};
use pmesh_view::{Client, Limits, Model, Session};
use proptest::prelude::*;
use std::sync::Arc;

/// Lets both ends talk until neither has anything to say; messages are lost after `most` bytes down.
fn talk(client: &mut Client, session: &mut Option<Session>, model: &Arc<Model>, view: &View, most: &mut u64) {
    for _ in 0..10_000 {
        while let Some(message) = client.poll() {
            match session {
                None => *session = Some(Session::open(&message, |_| Some(model.clone())).expect("it opens")),
                Some(s) => assert!(s.receive(&message).expect("it is a request")),
            }
        }
        let mut quiet = true;
        while let Some(message) = session.as_mut().and_then(|s| s.work(500, 2_000)) {
            if message.len() as u64 > *most {
                return;
            }
            *most -= message.len() as u64;
            client.receive(&message).expect("it is a reply");
            quiet = false;
        }
        if session.as_ref().is_some_and(Session::is_idle) {
            let progress = client.refine(view, u32::MAX).expect("a hierarchy");
            if quiet && progress.splits + progress.collapses == 0 && !client.is_waiting() {
                return;
            }
        }
    }
    let p = (0..4).map(|_| client.refine(view, u32::MAX)).collect::<Vec<_>>();
    panic!("they talk for ever: {p:?} waiting {} front {}", client.is_waiting(), client.front().len());
}

#[test]
fn g20_each_split_is_sent_once_and_the_second_lap_is_free() {
    let (_, model) = part();
    let (mut client, mut session) = (Client::new("part"), None);
    let mut most = u64::MAX;
    let views = lap(&model, 60);
    let mut laps = Vec::new();
    for _ in 0..2 {
        let mut faces = Vec::new();
        for view in &views {
            talk(&mut client, &mut session, &model, view, &mut most);
            faces.push(client.front().mesh().shown().len());
        }
        client.front().mesh().check_invariants();
        laps.push((client.bytes(), faces));
    }
    let counts = session.as_ref().expect("a session").counts();
    println!(
        "{} splits, {:.2} bytes each; up {}, down {}",
        counts.splits,
        counts.bytes_down as f64 / counts.splits as f64,
        counts.bytes_up,
        counts.bytes_down
    );
    assert_eq!(laps[0].0, laps[1].0, "the second lap costs nothing, neither way");
    assert_eq!(counts.splits, client.splits());
    assert_eq!(client.front().known() as u64, u64::from(model.hierarchy().root_count()) + 2 * counts.splits, "each once");
    assert!(counts.splits > 500 && client.front().known() < model.hierarchy().nodes().len());
    // Less is shown from afar than from near.
    let (least, most) = (laps[1].1.iter().min().expect("faces"), laps[1].1.iter().max().expect("faces"));
    assert!(10 * most > 11 * least, "{least} to {most}");
}

#[test]
fn g20_after_a_break_any_server_goes_on_from_what_the_client_has() {
    let (mesh, model) = part();
    let views = lap(&model, 24);
    let (mut whole, mut one) = (Client::new("part"), None);
    views.iter().for_each(|v| talk(&mut whole, &mut one, &model, v, &mut u64::MAX.clone()));
    let (mut client, mut session) = (Client::new("part"), None);
    let mut breaks = 0;
    let mut sent = 0;
    for (i, view) in views.iter().enumerate() {
        // Every second view, the line goes dead after some bytes; another server takes over, which has never heard of the client.
        let mut most = if i % 2 == 1 { 40 } else { u64::MAX };
        talk(&mut client, &mut session, &model, view, &mut most);
        if i % 2 == 1 {
            sent += session.take().map_or(0, |s| s.counts().splits);
            client.reconnect();
            talk(&mut client, &mut session, &model, view, &mut u64::MAX.clone());
            breaks += 1;
            let own: Vec<_> = client.front().leaves().map(|id| model.hierarchy().find(id).expect("a node")).collect();
            let tags = session.as_ref().expect("a session").tags();
            assert!(own.len() as u64 == tags.len() && own.iter().all(|&i| tags.contains(i)), "the same front");
        }
    }
    sent += session.as_ref().map_or(0, |s| s.counts().splits);
    assert_eq!(breaks, 12);
    assert_eq!(shown(&client), shown(&whole));
    assert_eq!(client.splits(), whole.splits());
    println!("{} splits, {sent} sent in all", client.splits());
    assert!(sent > client.splits() && sent < client.splits() + 12 * 500, "no more is sent twice than was in flight");
    // G.24: then all of it.
    talk(&mut client, &mut session, &model, &View::everything(), &mut u64::MAX.clone());
    assert!(client.has_all());
    assert_eq!(shown(&client), of(&mesh));
}

#[test]
fn limits_are_kept_by_a_coarser_tolerance_and_by_forgetting() {
    let (_, model) = part();
    let views = lap(&model, 24);
    let (mut free, mut one) = (Client::new("part"), None);
    views.iter().for_each(|v| talk(&mut free, &mut one, &model, v, &mut u64::MAX.clone()));
    let memory = free.front().memory_bytes() * 2 / 3;
    let (mut tight, mut session) = (Client::new("part"), None);
    tight.set_limits(Limits { memory, triangles: usize::MAX });
    for view in views.iter().chain(&views) {
        talk(&mut tight, &mut session, &model, view, &mut u64::MAX.clone());
        tight.front().mesh().check_invariants();
        assert!(tight.front().memory_bytes() <= memory, "{} of {memory}", tight.front().memory_bytes());
    }
    let evictions = tight.viewer().evictions();
    println!("{evictions} times forgotten; {} splits received, {} without a limit", tight.splits(), free.splits());
    assert!(evictions > 0 && tight.splits() > free.splits());
    // What the server thinks of is what is there.
    let own: Vec<_> = tight.front().leaves().map(|id| model.hierarchy().find(id).expect("a node")).collect();
    let tags = session.as_ref().expect("a session").tags();
    assert!(own.len() as u64 == tags.len() && own.iter().all(|&i| tags.contains(i)));
    let few = free.front().triangles() / 3;
    tight.set_limits(Limits { memory, triangles: few });
    talk(&mut tight, &mut session, &model, &views[0], &mut u64::MAX.clone());
    let (triangles, allowance) = (tight.front().triangles(), tight.viewer().allowance());
    assert!(triangles <= few + 20 && allowance > 0, "{triangles} of {few}, {allowance}");
}

#[test]
fn e19_names_instead_of_views_and_cuts_alone_show_the_same() {
    let (mesh, model) = part();
    let views = lap(&model, 6);
    let run = |client: Client| {
        let (mut client, mut session) = (client, None);
        let mut seen = Vec::new();
        for view in &views {
            talk(&mut client, &mut session, &model, view, &mut u64::MAX.clone());
            seen.push(shown(&client));
        }
        client.front().mesh().check_invariants();
        (seen, client, session)
    };
    let (seen, coded, _) = run(Client::new("part"));
    let (plain_seen, plain, _) = run(Client::new("part").with_packets(Packets::Plain));
    assert_eq!(plain_seen, seen);
    let (named_seen, named, _) = run(Client::new("part").by_names());
    assert_eq!(named_seen, seen);
    let (_, mut cuts, mut session) = run(Client::new("part").with_packets(Packets::CutsOnly));
    let each = |c: &Client| (c.bytes().1 as f64 - model.base().len() as f64) / c.splits() as f64;
    println!(
        "bytes a split: {:.2} coded, {:.2} plain, {:.2} by names, {:.2} cuts only",
        each(&coded),
        each(&plain),
        each(&named),
        each(&cuts)
    );
    println!("up: {} views, {} names", coded.bytes().0, named.bytes().0);
    assert!(named.bytes().0 > coded.bytes().0 && each(&plain) > 70.0 && each(&cuts) < 0.7 * each(&coded));
    assert_eq!(named.splits(), coded.splits());
    // A client that forgets nothing has what the server sent for all of the views.
    assert_eq!(cuts.splits(), coded.splits());
    assert_eq!(cuts.front().known() as u64, u64::from(model.hierarchy().root_count()) + 2 * cuts.splits());
    talk(&mut cuts, &mut session, &model, &View::everything(), &mut u64::MAX.clone());
    assert_eq!(shown(&cuts), of(&mesh));
}

#[test]
fn g24_all_of_a_session_is_the_mesh_bit_for_bit() {
    for (name, bits) in [("knot", Some(14)), ("marble", None), ("tetrahedra", Some(12)), ("part", None)] {
        let mesh = quantise(&plain(sample(name).expect("a sample").mesh), bits);
        let model = model_of(&mesh, bits);
        let (mut client, mut session) = (Client::new(name), None);
        for view in lap(&model, 5).iter().chain([&View::everything()]) {
            talk(&mut client, &mut session, &model, view, &mut u64::MAX.clone());
        }
        let counts = session.expect("a session").counts();
        println!("{name}: {} bytes, {:.2} a split", counts.bytes_down, counts.bytes_down as f64 / counts.splits.max(1) as f64);
        assert!(client.has_all());
        assert_eq!(client.front().known() as u64, client.total());
        assert_eq!(shown(&client), of(&mesh), "{name}");
    }
}

#[test]
fn g22_tags_take_a_tenth_of_a_list_of_nodes() {
    let mesh = quantise(&knot(1500, 100), Some(BITS));
    let model = model_of(&mesh, Some(BITS));
    let (mut client, mut session) = (Client::new("knot"), None);
    let mut window = (0, 0);
    let mut looked = 0;
    for view in lap(&model, 8).iter().chain([&View::everything()]) {
        talk(&mut client, &mut session, &model, view, &mut u64::MAX.clone());
        let tags = session.as_ref().expect("a session").tags();
        // The same decisions as an explicit front: the client's.
        let own: Vec<_> = client.front().leaves().map(|id| model.hierarchy().find(id).expect("a node")).collect();
        assert!(own.len() as u64 == tags.len() && own.iter().all(|&i| tags.contains(i)));
        let now = tags.window().expect("a front");
        assert!(now.0 >= window.0 && now.1 >= window.1, "the window moves right only");
        window = now;
        let (bytes, list) = (tags.memory_bytes() as f64, 16.0 * tags.len() as f64);
        println!("{} in the front: {:.3} of a list", tags.len(), bytes / list);
        assert!(tags.len() < 100_000 || bytes <= 0.1 * list);
        looked += u32::from(tags.len() >= 100_000);
        assert!(bytes <= list + 1024.0);
    }
    assert!(looked > 0);
}

#[test]
fn g25_messages_that_are_none_end_the_session_and_nothing_else() {
    let (_, model) = part();
    let find = |_: &str| Some(model.clone());
    let hello = message::request(&Request::Hello { model: "part".into(), packets: Default::default() });
    assert!(Session::open(&hello, |_| None).is_err());
    assert!(Session::open(&hello[..5], find).is_err());
    let mut session = Session::open(&hello, find).expect("it opens");
    assert!(session.receive(&hello).is_err(), "twice");
    let view = message::request(&Request::View(Box::new(lap(&model, 3)[0])));
    for at in 0..view.len() {
        let mut bad = view.clone();
        bad[at..].iter_mut().take(4).for_each(|b| *b = 0xff);
        let _ = session.receive(&bad);
        assert!(session.receive(&view[..at]).is_err());
        let _ = session.work(50, 500);
    }
    // A client that says it has what is not there, or too much, or too little.
    let shape = |bits: usize, count: u64| {
        let mut resume = message::request(&Request::Resume {
            model: "part".into(),
            packets: Default::default(),
            fingerprint: model.fingerprint(),
            shape: (0..bits).map(|_| true).collect(),
        });
        let at = resume.len() - bits.div_ceil(8) - 8;
        resume[at..at + 8].copy_from_slice(&count.to_le_bytes());
        Session::open(&resume, find).map(drop)
    };
    assert!(shape(100_000, 100_000).is_err());
    assert!(shape(8, u64::MAX).is_err());
    assert!(shape(0, 0).is_err());
    let other = message::request(&Request::Resume {
        model: "part".into(),
        packets: Default::default(),
        fingerprint: 7,
        shape: (0..60).map(|_| false).collect(),
    });
    assert!(Session::open(&other, find).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]
    #[test]
    fn g25_no_reply_makes_a_client_panic(kind in 0..4u32, cuts in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6), length in any::<prop::sample::Index>()) {
        let (_, model) = part();
        let of_kind = || match kind {
            0 => Client::new("part"),
            1 => Client::new("part").with_packets(Packets::Plain),
            2 => Client::new("part").with_packets(Packets::CutsOnly),
            _ => Client::new("part").by_names(),
        };
        let (mut client, mut session) = (of_kind(), None);
        let view = lap(&model, 7)[0];
        while let Some(m) = client.poll() {
            session = Some(Session::open(&m, |_| Some(model.clone())).expect("it opens"));
        }
        let mut session = session.expect("a session");
        let base = session.work(1, 1).expect("the base");
        client.receive(&base).expect("it is");
        client.refine(&view, u32::MAX).expect("a hierarchy");
        session.receive(&client.poll().expect("a view")).expect("it is");
        let mut other = of_kind();
        let mut damaged = base.clone();
        for (at, with) in &cuts {
            let at = at.index(damaged.len());
            damaged[at] ^= with;
        }
        let good = session.work(300, 5_000).expect("splits");
        let mut bad = good.clone();
        for (at, with) in cuts {
            let at = at.index(bad.len());
            bad[at] ^= with;
        }
        bad.truncate(length.index(bad.len()) + 1);
        let _ = client.receive(&bad);
        let _ = client.refine(&View::everything(), 10_000);
        client.front().mesh().check_invariants();
        // A base mesh that is damaged, and then what is good.
        if other.receive(&damaged).is_ok() && other.receive(&good).is_ok() {
            for view in [view, View::everything(), view] {
                let _ = other.refine(&view, 10_000);
            }
        }
    }
}
