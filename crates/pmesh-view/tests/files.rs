//! Views of a file, by nothing but ranges of its bytes.

mod common;

use common::{lap, model_of, of, part};
use pmesh_core::hierarchy::{NONE, View};
use pmesh_view::{
    BlockSizes, Client, FileClient, Limits, Model, Session, is_file, read_model, read_whole, write_file, write_file_of,
};

/// Fetches and refines until a view has all that it needs.
fn settle(client: &mut FileClient, file: &[u8], view: &View) {
    for _ in 0..10_000 {
        while let Some((start, end)) = client.poll() {
            let end = end.min(file.len() as u64);
            client.receive(start, &file[start as usize..end as usize]).expect("the file is good");
        }
        let progress = client.refine(view, u32::MAX).expect("a hierarchy");
        if progress.splits + progress.collapses == 0 && !client.is_waiting() && !progress.wants_more {
            return;
        }
    }
    panic!("it never comes to rest");
}
/// What a session needs for the whole model.
fn session_bytes(model: &std::sync::Arc<Model>) -> u64 {
    let mut client = Client::new("m");
    let hello = client.poll().expect("a hello");
    let mut session = Session::open(&hello, |_| Some(model.clone())).expect("it opens");
    while !client.has_all() {
        while let Some(message) = session.work(1000, 20_000) {
            client.receive(&message).expect("a reply");
        }
        client.refine(&View::everything(), u32::MAX).expect("a hierarchy");
        while let Some(message) = client.poll() {
            session.receive(&message).expect("a request");
        }
    }
    session.counts().bytes_down
}

#[test]
fn a_whole_file_is_the_mesh() {
    for (mesh, model) in [part(), common::of_sample("marble"), common::of_sample("knot"), common::of_sample("tetrahedra")] {
        let (file, spent) = write_file(&model).expect("a hierarchy");
        assert!(is_file(&file));
        let back = read_whole(&file).expect("it reads");
        assert_eq!(of(&back), of(&mesh));
        // And a server has it from there.
        let again = read_model(&file).expect("it reads");
        let mut cuts: Vec<_> = (0..again.hierarchy().nodes().len() as u32).map(|i| again.hierarchy().id(i)).collect();
        cuts.dedup();
        assert_eq!(cuts.len(), model.hierarchy().nodes().len());
        for i in 0..model.hierarchy().nodes().len() as u32 {
            let (own, id) = (model.hierarchy().nodes()[i as usize], model.hierarchy().id(i).expect("a node"));
            let other = again.hierarchy().nodes()[again.hierarchy().find(id).expect("it is there") as usize];
            assert_eq!(own.bounds, other.bounds);
            let name = |m: &Model, c: u32| (c != NONE).then(|| m.hierarchy().id(c).expect("a node"));
            assert_eq!(own.cuts.map(|c| name(&model, c)), other.cuts.map(|c| name(&again, c)));
        }
        let session = session_bytes(&model);
        let bits = (spent.names + spent.positions + spent.cuts + spent.bounds) / 8.0;
        println!(
            "{} triangles: {} bytes, {bits:.0} of splits; a session of all of it: {session}",
            mesh.triangles.len(),
            file.len()
        );
        // A block says what a session need not, which knows more.
        let (bytes, splits) = (file.len() as u64, mesh.vertices.len() as u64);
        assert!(bytes <= 2 * session + 100 && bytes - model.base().len() as u64 <= 6 * splits + 100);
    }
}

/// Blocks of a few splits, at whose rims everything is coarse: many cuts are at one node there, and the rest must be told by names.
#[test]
fn small_blocks_hold_the_mesh_too() {
    for name in ["part", "marble", "globe"] {
        let (mesh, model) = common::of_sample(name);
        for (first, others) in [(1, 1), (40, 9), (500, 60)].into_iter().skip(usize::from(name != "part")) {
            let sizes = BlockSizes { first, others };
            let (file, _) = write_file_of(&model, sizes).expect("a hierarchy");
            println!("{name} {sizes:?}: {} bytes", file.len());
            assert_eq!(of(&read_whole(&file).expect("it reads")), of(&mesh));
        }
    }
}

#[test]
fn a_view_takes_what_it_sees_and_a_second_lap_is_free() {
    let (_, model) = common::of_sample("marble");
    let (file, _) = write_file(&model).expect("a hierarchy");
    let mut client = FileClient::default();
    let views = lap(&model, 40);
    for view in &views {
        settle(&mut client, &file, view);
    }
    client.viewer().front().mesh().check_invariants();
    let traffic = client.traffic();
    println!("{traffic:?} requests and bytes of {}", file.len());
    // The end of the first request is the beginning of a block.
    assert!(traffic.1 < file.len() as u64 + 16_384, "{traffic:?} of {}", file.len());
    for view in &views {
        settle(&mut client, &file, view);
    }
    assert_eq!(client.traffic(), traffic, "a second lap is free");
    // One view of it takes less, and shows about the same.
    let last = views.last().expect("a view");
    let mut fresh = FileClient::default();
    settle(&mut fresh, &file, last);
    println!("{:?} for one view", fresh.traffic());
    assert!(fresh.traffic().1 < traffic.1 * 2 / 3);
    assert!(fresh.viewer().front().len().abs_diff(client.viewer().front().len()) < client.viewer().front().len() / 10);
}

#[test]
fn what_is_forgotten_is_fetched_again() {
    let (_, model) = common::of_sample("marble");
    let (file, _) = write_file(&model).expect("a hierarchy");
    let mut free = FileClient::default();
    let mut tight = FileClient::default();
    let views = lap(&model, 24);
    for view in &views {
        settle(&mut free, &file, view);
    }
    let memory = free.viewer().memory_bytes() * 2 / 3;
    tight.set_limits(Limits { memory, ..Default::default() });
    for view in (0..5).flat_map(|_| &views) {
        settle(&mut tight, &file, view);
        tight.viewer().front().mesh().check_invariants();
        // Blocks that several views have in common may be whole again.
        assert!(tight.viewer().memory_bytes() < memory * 3 / 2);
    }
    assert!(tight.viewer().evictions() > 0);
    // What came once stays, in the few bytes in which it came.
    assert!(tight.traffic().1 <= file.len() as u64 + 16_384, "{:?} of {}", tight.traffic(), file.len());
    let (a, b) = (tight.viewer().front(), free.viewer().front());
    println!("{} times forgotten; {} and {} in the front, {:?}", tight.viewer().evictions(), a.len(), b.len(), tight.traffic());
    // Everything it knows is right.
    for i in 0..a.known() as u32 {
        let known = a.node(i).expect("it is known");
        let all = model.hierarchy().find(a.id(i)).expect("it is there");
        assert_eq!(known.position, model.hierarchy().position(all));
        assert_eq!(known.bounds, model.hierarchy().nodes()[all as usize].bounds);
        if known.child != NONE {
            let cuts = model.hierarchy().nodes()[all as usize]
                .cuts
                .map(|c| (c != NONE).then(|| model.hierarchy().id(c).expect("a leaf")));
            for (own, all) in known.cuts.iter().zip(cuts) {
                assert_eq!(own.is_some(), all.is_some());
                assert!(own.zip(all).is_none_or(|(own, all)| own.is_above(all)));
            }
        }
    }
}

#[test]
fn g25_damaged_files_are_refused() {
    let mesh = pmesh_build::sample::knot(24, 9);
    let model = model_of(&mesh, Some(10));
    let (file, _) = write_file(&model).expect("a hierarchy");
    read_whole(&file).expect("it reads");
    for i in 0..file.len() {
        for flip in [1u8, 0x80] {
            let mut bad = file.clone();
            bad[i] ^= flip;
            assert!(read_whole(&bad).is_err(), "byte {i}");
        }
        assert!(read_whole(&file[..i]).is_err(), "{i} bytes");
    }
    // Checksums that are right do not make it one.
    let mut state = 1u32;
    let mut refused = 0;
    for _ in 0..4000 {
        let mut bad = file.clone();
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let at = state as usize % bad.len();
        bad[at] ^= (state >> 24) as u8 | 1;
        common::mend(&mut bad);
        match read_whole(&bad) {
            // Another mesh then, but one that can be drawn.
            Ok(other) => {
                let count = other.vertices.len() as u32;
                assert!(other.triangles.iter().flatten().all(|&v| v < count));
            }
            Err(_) => refused += 1,
        }
    }
    println!("{refused} of 4000 refused");
    assert!(refused > 1000, "{refused}");
}
