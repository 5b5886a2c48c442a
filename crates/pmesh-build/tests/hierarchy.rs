//! The truly selective scheme on hierarchies of real collapses: G.19, G.21, G.24.

use pmesh_build::hierarchy::hierarchy;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::{Front, NONE, NodeId, Split, VertexHierarchy, View};

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
