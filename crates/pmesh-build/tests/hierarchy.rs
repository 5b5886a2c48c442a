//! The truly selective scheme on hierarchies of real collapses: G.19, G.21, G.24.

use pmesh_build::hierarchy::hierarchy;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::{Allowance, Front, NONE, NodeId, Split, VertexHierarchy, View};

/// Positions only, without seams.
fn model(name: &str) -> IndexedMesh {
    let mesh = sample(name).expect("a sample").mesh;
    let mut plain = IndexedMesh { triangles: mesh.triangles, ..Default::default() };
    plain.vertices.positions = mesh.vertices.positions;
    plain
}

fn whole(mesh: &IndexedMesh) -> VertexHierarchy {
    let stream = collapse_batches(mesh, BatchOptions::default(), |_| ());
    hierarchy(mesh, &stream).expect("a hierarchy")
}

fn client(all: &VertexHierarchy) -> Front {
    let roots = 0..all.root_count();
    let bounds: Vec<_> = roots.clone().map(|i| all.nodes()[i as usize].bounds).collect();
    Front::new(roots.map(|i| all.position(i)).collect(), &bounds, all.base_triangles().to_vec(), all.unit()).expect("a front")
}

fn split(all: &VertexHierarchy, i: u32) -> Split {
    let node = all.nodes()[i as usize];
    let bounds = [node.child, node.child + 1].map(|c| all.nodes()[c as usize].bounds);
    let cuts = node.cuts.map(|c| (c != NONE).then(|| all.id(c).expect("a leaf")));
    Split { id: all.id(i).expect("a node"), cuts, position: all.position(node.child + 1), bounds }
}

/// Triangles of the front by positions, each turned to begin with its lowest, sorted.
fn triangles(front: &Front) -> Vec<[[u32; 3]; 3]> {
    let at = |v: u32| front.positions()[v as usize].map(f32::to_bits);
    sorted(front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)).map(|t| t.map(at)))
}
fn sorted(triangles: impl Iterator<Item = [[u32; 3]; 3]>) -> Vec<[[u32; 3]; 3]> {
    let mut all: Vec<_> = triangles.map(|[a, b, c]| [a, b, c].min([b, c, a]).min([c, a, b])).collect();
    all.sort_unstable();
    all
}

/// By definition: the finest triangles whose corners stand at three nodes of the front.
fn by_definition(all: &VertexHierarchy, mesh: &IndexedMesh, front: &Front) -> Vec<[[u32; 3]; 3]> {
    let mut node_of = vec![NONE; mesh.vertices.len()];
    for id in front.front() {
        let mut below = vec![all.find(id).expect("a node")];
        let top = all.nodes()[below[0] as usize].vertex;
        while let Some(i) = below.pop() {
            let n = all.nodes()[i as usize];
            if n.child == NONE { node_of[n.vertex as usize] = top } else { below.extend([n.child, n.child + 1]) }
        }
    }
    let corners = mesh.triangles.iter().map(|t| t.map(|v| node_of[v as usize])).filter(|[a, b, c]| a != b && b != c && c != a);
    sorted(corners.map(|t| t.map(|v| mesh.vertices.positions[v as usize].map(f32::to_bits))))
}

fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

#[test]
fn g21_any_order_of_splits_and_collapses_keeps_a_manifold() {
    for name in ["knot", "part", "marble"] {
        let mesh = model(name);
        let all = whole(&mesh);
        let mut front = client(&all);
        let inner: Vec<u32> = (0..all.nodes().len() as u32).filter(|&i| all.nodes()[i as usize].child != NONE).collect();
        inner.iter().for_each(|&i| front.learn(&split(&all, i)).expect("it is new"));
        let (mut state, mut splits, mut collapses, mut refused, mut forced) = (7, 0, 0, 0, 0);
        for step in 0..60_000u32 {
            // Deep in a few places, and then back.
            let wild = random(&mut state) % inner.len() as u64;
            let i = inner[if step % 3 == 0 { wild } else { wild / 8 } as usize];
            let id = all.id(i).expect("a node");
            if step / 5_000 % 2 == 0 {
                if let Ok(done) = front.split(id) {
                    splits += done;
                    forced += done - 1;
                }
            } else if front.collapse(id) {
                collapses += 1;
            } else {
                refused += 1;
            }
            if step % 10_000 == 4_321 {
                front.mesh().check_invariants();
                assert_eq!(triangles(&front), by_definition(&all, &mesh, &front), "{name} after {step}");
            }
        }
        println!(
            "{name}: {splits} splits, {forced} of them forced, {collapses} collapses, {refused} refused; {} in the front",
            front.len()
        );
        assert!(splits > 1000 && collapses > 100);
        front.mesh().check_invariants();
        // G.24: all of it is the mesh.
        while front.refine(&View::everything(), u32::MAX).expect("a hierarchy").splits > 0 {}
        front.mesh().check_invariants();
        let own = mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices.positions[v as usize].map(f32::to_bits)));
        assert_eq!(triangles(&front), sorted(own), "{name}");
        assert_eq!(front.len(), mesh.vertices.len());
    }
}

#[test]
fn g19_what_is_above_a_leaf_is_found_without_knowing_what_is_between() {
    let mesh = model("marble");
    let all = whole(&mesh);
    let mut front = client(&all);
    let mut state = 3;
    let leaves: Vec<u32> = (0..all.nodes().len() as u32).filter(|&i| all.nodes()[i as usize].child == NONE).collect();
    let mut active: std::collections::HashSet<u32> = (0..all.root_count()).collect();
    let mut learnt = std::collections::HashSet::new();
    for round in 0..40 {
        for _ in 0..25_000 {
            let leaf = leaves[random(&mut state) as usize % leaves.len()];
            let whole = all.active_ancestor(leaf, |i| active.contains(&i)).expect("there is one");
            let id = all.id(leaf).expect("a leaf");
            assert_eq!(front.active_ancestor(id), all.id(whole));
            assert_eq!(id.active_ancestor(|n| all.find(n).is_some_and(|i| active.contains(&i))), all.id(whole));
            assert_eq!(all.find(id), Some(leaf));
        }
        let now: Vec<u32> =
            active.iter().copied().filter(|&i| (i + round) % 3 == 0 && all.nodes()[i as usize].child != NONE).collect();
        for i in now {
            if learnt.insert(i) {
                front.learn(&split(&all, i)).expect("it is new");
            }
            // What must go first may not be known yet: then it is tried again.
            let _ = front.split(all.id(i).expect("a node"));
        }
        active = front.front().map(|id| all.find(id).expect("a node")).collect();
    }
    println!("{} in the front of {} nodes known", active.len(), front.known());
}

fn knowing_all(all: &VertexHierarchy) -> Front {
    let mut front = client(all);
    let inner = (0..all.nodes().len() as u32).filter(|&i| all.nodes()[i as usize].child != NONE);
    inner.for_each(|i| front.learn(&split(all, i)).expect("it is new"));
    front
}
fn view(eye: [f32; 3], tolerance: f32) -> View {
    View::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], [0.3, 1.0, tolerance]).expect("a view")
}
/// Where a view shows a point, in parts of the viewport's height.
fn seen(view: &View, p: [f32; 3]) -> Option<[f64; 2]> {
    let (m, tangent, ..) = view.parts();
    let at = |row: usize| (0..3).map(|k| f64::from(m[4 * k + row]) * f64::from(p[k])).sum::<f64>() + f64::from(m[12 + row]);
    let depth = -at(2);
    (depth > 1e-3).then(|| [at(0), at(1)].map(|x| x / depth / (2.0 * f64::from(tangent))))
}

#[test]
fn with_the_camera_still_no_vertex_moves_more_than_a_pixel_a_frame() {
    let mesh = model("marble");
    let all = whole(&mesh);
    let mut front = knowing_all(&all);
    front.draw();
    let pixel = 1.0 / 500.0;
    let eyes = [[0.0, 0.4, 3.0], [0.3, 0.2, 1.4], [-3.0, 0.0, 0.5], [0.0, 9.0, 1.0]];
    let (mut splits, mut collapses, mut farthest) = (0, 0, 0.0f64);
    for eye in eyes.into_iter().cycle().take(6) {
        let view = view(eye, pixel as f32);
        let mut still = 0;
        for frame in 0.. {
            assert!(frame < 5_000, "it never comes to rest: {:?}", front.under_way());
            let before = front.drawn_positions().to_vec();
            let was_there: std::collections::HashSet<u32> =
                front.mesh().shown().iter().filter_map(|&t| front.mesh().triangle(t)).flatten().collect();
            let progress = front.refine(&view, 3_000).expect("a hierarchy");
            let under_way = front.advance(&view, pixel, u32::MAX).expect("a hierarchy");
            (splits, collapses) = (splits + progress.splits, collapses + progress.collapses);
            let moves = before.iter().zip(front.drawn_positions()).enumerate();
            for (v, (a, b)) in moves.filter(|(v, _)| was_there.contains(&(*v as u32))) {
                let (Some(p), Some(q)) = (seen(&view, *a), seen(&view, *b)) else { continue };
                // Outside the picture they may be faster.
                if p.iter().any(|x| x.abs() > 0.5) {
                    continue;
                }
                let far = (p[0] - q[0]).hypot(p[1] - q[1]);
                farthest = farthest.max(far);
                assert!(far <= pixel, "vertex {v} moves by {} pixels in frame {frame}", far / pixel);
            }
            let rests = progress.splits + progress.collapses + under_way.moving + under_way.turning == 0;
            still = if rests { still + progress.looked } else { 0 };
            if still as usize > front.len() {
                break;
            }
        }
        front.mesh().check_invariants();
        // At rest it is the mesh that stands still.
        for &t in front.mesh().shown() {
            for v in front.mesh().triangle(t).expect("it is there") {
                assert_eq!(front.drawn_positions()[v as usize], front.positions()[v as usize]);
                let n = front.drawn_normals()[v as usize];
                assert!((n.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-3 || n == [0.0; 3], "{n:?}");
            }
        }
        assert_eq!(triangles(&front), by_definition(&all, &mesh, &front));
    }
    println!("{splits} splits, {collapses} collapses, {:.3} pixels at most", farthest / pixel);
    assert!(splits > 5_000 && collapses > 5_000 && farthest > 0.5 * pixel);
}

#[test]
fn changes_that_are_taken_are_all_that_a_renderer_needs() {
    let mesh = model("part");
    let all = whole(&mesh);
    let mut front = knowing_all(&all);
    front.draw();
    let (mut positions, mut triangles): (Vec<[f32; 3]>, Vec<Option<[u32; 3]>>) = Default::default();
    for frame in 0..600u32 {
        let a = frame as f32 * 0.02;
        let view = view([4.0 * a.sin(), 1.0, (4.0 - a / 4.0) * a.cos()], 0.002);
        front.refine(&view, 500).expect("a hierarchy");
        front.advance(&view, 0.002, 500).expect("a hierarchy");
        if frame % 100 == 99 {
            front.forget_below();
            front.mesh().check_invariants();
        }
        for v in front.take_changed_vertices() {
            positions.resize(positions.len().max(v as usize + 1), [0.0; 3]);
            positions[v as usize] = front.drawn_positions()[v as usize];
        }
        for place in front.take_changed_places() {
            triangles.resize(triangles.len().max(place as usize + 1), None);
            triangles[place as usize] = front.mesh().shown().get(place as usize).and_then(|&t| front.mesh().triangle(t));
        }
        let shown = front.mesh().shown();
        assert!(triangles.len() >= shown.len());
        assert!(shown.iter().zip(&triangles).all(|(&t, seen)| front.mesh().triangle(t) == *seen), "frame {frame}");
        assert!(
            triangles[..shown.len()]
                .iter()
                .flatten()
                .flatten()
                .all(|&v| positions[v as usize] == front.drawn_positions()[v as usize])
        );
    }
}

#[test]
fn what_is_forgotten_can_be_learnt_again() {
    let mesh = model("marble");
    let all = whole(&mesh);
    let mut front = knowing_all(&all);
    let near = view([0.0, 0.3, 1.6], 0.004);
    let far = view([0.0, 2.0, 9.0], 0.004);
    for (view, is_near) in [(&near, true), (&far, false), (&near, true)] {
        let mut splits: Vec<u32> = (0..all.nodes().len() as u32).filter(|&i| all.nodes()[i as usize].child != NONE).collect();
        splits.retain(|&i| front.find(all.id(i).expect("a node")).is_none_or(|n| front.node(n).is_some_and(|n| n.child == NONE)));
        splits.iter().for_each(|&i| front.learn(&split(&all, i)).expect("it is new"));
        while front.refine(view, u32::MAX).is_ok_and(|p| p.splits + p.collapses > 0) {}
        let (before, bytes, known) = (triangles(&front), front.memory_bytes(), front.known());
        front.forget_below();
        front.mesh().check_invariants();
        assert_eq!(triangles(&front), before);
        assert!(front.known() <= 2 * front.len() && front.known() < known);
        println!("near {is_near}: {known} nodes, {bytes} bytes; then {}, {}", front.known(), front.memory_bytes());
        assert!(front.memory_bytes() < bytes);
        for id in front.front() {
            let i = all.find(id).expect("a node");
            let known = front.node(front.find(id).expect("it is known")).expect("it is known");
            assert_eq!((known.position, known.bounds), (all.position(i), all.nodes()[i as usize].bounds));
        }
    }
}

#[test]
fn a_limit_on_triangles_is_kept_and_comes_to_rest() {
    let mesh = model("marble");
    let all = whole(&mesh);
    let mut front = knowing_all(&all);
    front.draw();
    let mut allowance = Allowance::default();
    let mut rest = |front: &mut Front, asked: &View, limit: usize| {
        front.limit_triangles(limit);
        let (mut quiet, mut most) = (0, front.mesh().shown().len());
        for frame in 0.. {
            assert!(frame < 20_000, "no rest under {limit}: {} triangles, step {}", front.triangles(), allowance.step());
            let view = allowance.view(asked);
            let before = allowance.step();
            let progress = front.refine(&view, 2_000).expect("a hierarchy");
            let under_way = front.advance(&view, f64::INFINITY, u32::MAX).expect("a hierarchy");
            allowance.learn(&progress, (front.len(), under_way.leaving), front.triangles(), limit);
            // A forced split may pass by it.
            assert!(front.mesh().shown().len() < limit.max(most).saturating_add(50));
            most = front.mesh().shown().len();
            let still = progress.splits + progress.collapses + under_way.moving == 0 && allowance.step() == before;
            quiet = if still { quiet + progress.looked as usize } else { 0 };
            if quiet > 3 * front.len() {
                break;
            }
        }
        (front.triangles(), allowance.step())
    };
    let near = view([0.0, 0.3, 1.6], 0.002);
    let (free, step) = rest(&mut front, &near, usize::MAX);
    assert_eq!(step, 0);
    let (few, step) = rest(&mut front, &near, free / 4);
    assert!(step > 0 && few <= free / 4 + 50 && few > free / 10, "{few} of {free}");
    let (far, step) = rest(&mut front, &view([0.0, 2.0, 30.0], 0.002), free / 4);
    assert_eq!(step, 0, "{far} triangles are few enough");
    let (again, _) = rest(&mut front, &near, free / 4);
    assert!(again.abs_diff(few) < few / 3, "{again} and {few}");
    println!("{free} triangles; {few} and {again} of {} allowed", free / 4);
}

#[test]
fn g25_names_and_cuts_that_cannot_be_are_refused() {
    let mesh = model("part");
    let all = whole(&mesh);
    let mut front = client(&all);
    let good = split(&all, 0);
    for node in [0, 2, u64::MAX, 1 << 63] {
        assert!(front.learn(&Split { id: NodeId { tree: 0, node }, ..good }).is_err(), "{node}");
        assert!(front.learn(&Split { cuts: [Some(NodeId { tree: 0, node }), good.cuts[1]], ..good }).is_err(), "{node}");
    }
    assert!(front.learn(&Split { id: NodeId { tree: u32::MAX, node: 1 }, ..good }).is_err());
    assert!(front.learn(&Split { cuts: [Some(NodeId { tree: u32::MAX, node: 1 }), None], ..good }).is_err());
    assert!(front.learn(&Split { cuts: [None, None], ..good }).is_err());
    assert!(front.learn(&Split { position: [f32::NAN; 3], ..good }).is_err());
    front.learn(&good).expect("it is new");
    assert!(front.learn(&good).is_err(), "twice");
    // Cuts that are elsewhere: the mesh stays as it was.
    let far = (1..all.root_count()).map(NodeId::root).rev().take(2).collect::<Vec<_>>();
    let id = NodeId::root(1);
    front.learn(&Split { id, cuts: [Some(far[0]), Some(far[1])], ..good }).expect("it could be");
    let before = triangles(&front);
    if front.split(id).is_err() {
        assert_eq!(triangles(&front), before);
    }
    front.mesh().check_invariants();
}

#[test]
fn g25_a_vertex_that_goes_twice_is_refused() {
    let mesh = model("part");
    let mut stream = collapse_batches(&mesh, BatchOptions::default(), |_| ());
    let first = stream.levels.last().expect("a level")[0].clone();
    stream.levels[0].push(first.clone());
    assert!(hierarchy(&mesh, &stream).is_err());
    // Onto one that is gone.
    stream.levels[0].last_mut().expect("a collapse").vertex = first.apex;
    stream.levels[0].last_mut().expect("a collapse").apex = first.vertex;
    assert!(hierarchy(&mesh, &stream).is_err());
}
