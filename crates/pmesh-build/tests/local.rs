//! Local refinement: any state that the partial order allows is the mesh that its collapses make, and forbidden ones cannot be reached
//! (G.10; A.26–A.29, D.11–D.13).

mod common;

use common::ground;
use pmesh_build::hierarchy::hierarchy;
use pmesh_build::rule::{Replay, replay};
use pmesh_build::sample::{knot, marble};
use pmesh_build::simplify::{BatchOptions, Placement, SimplifyOptions, collapse_batches, simplify};
use pmesh_core::IndexedMesh;
use pmesh_core::hierarchy::{Front, HierarchyError, NONE, Split, VertexHierarchy, View};
use pmesh_core::local::{ConstraintGraph, LocalMesh, Refiner, Refusal};
use proptest::prelude::*;

type Pairs = Vec<(u32, u32)>;

fn collapses_of(mesh: &IndexedMesh) -> (Pairs, Replay) {
    let options = SimplifyOptions { target_triangles: 8, placement: Placement::Kept };
    let pairs = simplify(mesh, options, |_| ()).expect("it simplifies").pairs;
    let replayed = replay(mesh, &pairs).expect("it replays");
    (pairs, replayed)
}

fn graph_of(r: &Replay) -> ConstraintGraph {
    ConstraintGraph::new(r.collapses.iter().map(|c| &c.requires[..])).expect("earlier ones are required")
}

fn local(mesh: &IndexedMesh, pairs: &Pairs, r: &Replay) -> LocalMesh {
    LocalMesh::new(mesh.vertices.len() as u32, &mesh.triangles, pairs, graph_of(r)).expect("it is in order")
}

/// Triangles by what they are, whatever corner comes first.
fn sorted(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
    let turned = |t: [u32; 3]| [t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]].into_iter().min().unwrap_or(t);
    let mut all: Vec<_> = triangles.map(turned).collect();
    all.sort_unstable();
    all
}

fn shown(l: &LocalMesh) -> Vec<[u32; 3]> {
    sorted(l.shown().iter().filter_map(|&t| l.triangle(t)))
}

/// The mesh after the collapses that are done, made one by one, and each with the star and the triangles that it had in the first place.
fn check_against_a_replay(mesh: &IndexedMesh, pairs: &Pairs, r: &Replay, l: &LocalMesh) {
    l.graph().check_invariants();
    let done: Vec<u32> = (0..pairs.len() as u32).filter(|&i| l.graph().is_collapsed(i)).collect();
    let again = replay(mesh, &done.iter().map(|&i| pairs[i as usize]).collect::<Vec<_>>()).expect("it replays");
    for (a, &i) in again.collapses.iter().zip(&done) {
        let first = &r.collapses[i as usize];
        assert_eq!((&a.star, &a.blue_triangles), (&first.star, &first.blue_triangles), "collapse {i}");
    }
    let mut at: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for &i in &done {
        let (blue, red) = pairs[i as usize];
        at.iter_mut().filter(|v| **v == blue).for_each(|v| *v = red);
    }
    let expected = mesh.triangles.iter().map(|t| t.map(|v| at[v as usize])).filter(|[a, b, c]| a != b && b != c && c != a);
    assert_eq!(shown(l), sorted(expected));
}

#[test]
fn a26_a_collapse_waits_for_those_it_requires_and_they_for_it() {
    // V requires I and III, as in the paper; and as its count of constraints says (A.27).
    let mut graph = ConstraintGraph::new([&[][..], &[], &[0, 1]]).expect("earlier ones are required");
    assert_eq!([0, 1, 2].map(|i| graph.constraints(i)), [(1, 0), (1, 0), (0, 0)]);
    assert_eq!(graph.split(0), Err(Refusal::CannotSplit { collapse: 0 }));
    graph.split(2).expect("nothing requires it");
    assert_eq!([0, 1, 2].map(|i| graph.constraints(i)), [(0, 0), (0, 0), (0, 0)]);
    graph.split(0).expect("nothing that requires it is done");
    assert_eq!(graph.constraints(2), (0, 1));
    assert_eq!(graph.collapse(2), Err(Refusal::CannotCollapse { collapse: 2 }));
    assert_eq!(graph.split(0), Err(Refusal::CannotSplit { collapse: 0 }));
    assert_eq!(graph.split(3), Err(Refusal::NoSuchCollapse { collapse: 3 }));
    assert_eq!(graph.collapse(u32::MAX), Err(Refusal::NoSuchCollapse { collapse: u32::MAX }));
    assert_eq!(graph.collapse_order(&[2]), Ok(vec![0, 2]));
    assert_eq!(graph.split_order(&[0, 9]), Err(Refusal::NoSuchCollapse { collapse: 9 }));
    graph.check_invariants();
}

#[test]
fn orders_that_are_none_are_refused() {
    let error = ConstraintGraph::new([&[0][..]]).expect_err("it requires itself");
    assert_eq!(error, Refusal::NotEarlier { collapse: 0, requires: 0 });
    let graph = || ConstraintGraph::new([&[][..], &[]]).expect("no order at all");
    let bad = |pairs: &[(u32, u32)]| LocalMesh::new(4, &[[0, 1, 2]], pairs, graph()).expect_err("it is bad");
    assert_eq!(bad(&[(0, 1), (0, 2)]), Refusal::BadVertex { collapse: 1, vertex: 0 });
    assert_eq!(bad(&[(0, 1), (3, 4)]), Refusal::BadVertex { collapse: 1, vertex: 4 });
    assert_eq!(bad(&[(0, 0), (3, 2)]), Refusal::BadVertex { collapse: 0, vertex: 0 });
    // 1 could be gone while 0 stands at it.
    assert_eq!(bad(&[(0, 1), (1, 2)]), Refusal::BadVertex { collapse: 1, vertex: 1 });
    assert_eq!(bad(&[(0, 1)]), Refusal::NoSuchCollapse { collapse: 1 });
    let beyond = LocalMesh::new(2, &[[0, 1, 2]], &[], ConstraintGraph::default()).expect_err("there is no vertex 2");
    assert_eq!(beyond, Refusal::BadVertex { collapse: 0, vertex: 2 });
}

#[test]
fn a29_what_is_asked_for_is_split_in_an_order_that_is_allowed_and_nothing_else() {
    let mesh = knot(40, 8);
    let (pairs, r) = collapses_of(&mesh);
    for wanted in [vec![0], vec![5, 17, 40], vec![pairs.len() as u32 - 1], (0..pairs.len() as u32).collect::<Vec<_>>()] {
        let mut l = local(&mesh, &pairs, &r);
        let order = l.graph().split_order(&wanted).expect("they exist");
        // All that requires them, directly or not.
        let mut needed = vec![false; pairs.len()];
        wanted.iter().for_each(|&i| needed[i as usize] = true);
        for i in 0..pairs.len() {
            let requires_one = r.collapses[i].requires.iter().any(|&j| needed[j as usize]);
            needed[i] |= requires_one;
        }
        assert_eq!(order.len(), needed.iter().filter(|n| **n).count());
        order.iter().for_each(|&i| assert!(l.split(i).is_ok()));
        assert!(order.iter().all(|&i| needed[i as usize]));
        check_against_a_replay(&mesh, &pairs, &r, &l);
        let back = l.graph().collapse_order(&order).expect("they exist");
        back.iter().for_each(|&i| assert!(l.collapse(i).is_ok()));
        check_against_a_replay(&mesh, &pairs, &r, &l);
    }
}

#[test]
fn d13_a_view_is_followed_and_left_again() {
    let mesh = marble(50, 40);
    let (pairs, r) = collapses_of(&mesh);
    let mut l = local(&mesh, &pairs, &r);
    // Near one pole all that is there; nothing far from it.
    let position = |i: u32| mesh.vertices.positions[pairs[i as usize].0 as usize];
    let (one, other) = (mesh.vertices.positions[0], mesh.vertices.positions[mesh.vertices.len() - 1]);
    let (low, high) = mesh.bounds();
    let far = |i: u32, pole: [f32; 3]| {
        let p = position(i);
        (0..3).map(|k| ((p[k] - pole[k]) / (high[0] - low[0])).powi(2)).sum::<f32>().sqrt()
    };
    // The error of a collapse bounds those of what it requires.
    let errors = |pole: [f32; 3]| {
        let mut nearest: Vec<f32> = Vec::new();
        for (i, c) in r.collapses.iter().enumerate() {
            nearest.push(c.requires.iter().map(|&j| nearest[j as usize]).fold(far(i as u32, pole), f32::min));
        }
        move |i: u32| 0.3 - nearest[i as usize]
    };
    let first = errors(one);
    let coarsest = l.shown().len();
    let mut refiner = Refiner::new(&l, &first);
    let work = refiner.refine(&mut l, &first, 0.0, 10).expect("it refines");
    assert_eq!((work.splits, work.is_done), (10, false));
    let work = refiner.refine(&mut l, &first, 0.0, u32::MAX).expect("it refines");
    assert!(work.is_done);
    check_against_a_replay(&mesh, &pairs, &r, &l);
    let is_settled = |l: &LocalMesh, error: &dyn Fn(u32) -> f32| {
        (0..l.graph().len()).all(|i| !(l.graph().can_split(i) && error(i) > 0.0 || l.graph().can_collapse(i) && error(i) < 0.0))
    };
    assert!(is_settled(&l, &first));
    assert!(l.shown().len() > coarsest && l.shown().len() < mesh.triangles.len() / 2, "{} triangles", l.shown().len());
    // The view turns to the other pole: there it is fine now, and coarse here.
    let second = errors(other);
    refiner.refresh(&l, &second);
    let work = refiner.refine(&mut l, &second, 0.0, u32::MAX).expect("it refines");
    assert!(work.splits > 0 && work.collapses > 0 && work.is_done, "{work:?}");
    assert!(is_settled(&l, &second));
    check_against_a_replay(&mesh, &pairs, &r, &l);
    // What is not a number is no error and no bound.
    refiner.refresh(&l, |_| f32::NAN);
    let work = refiner.refine(&mut l, |_| f32::NAN, f32::NAN, u32::MAX).expect("it refines");
    assert_eq!((work.splits, work.collapses, work.is_done), (0, 0, true));
    refiner.refine(&mut l, |_| f32::NAN, 0.1, u32::MAX).expect("it refines");
    assert_eq!(l.shown().len(), coarsest);
}

/// Both schemes by one front: that of the truly selective one, which keeps to the order, is at every view the mesh that the order makes.
#[test]
fn one_front_follows_views_by_either_scheme() {
    for (name, mesh) in [("marble", marble(50, 40)), ("knot", knot(80, 16))] {
        let stream = collapse_batches(&mesh, BatchOptions::default(), |_| ());
        let all = hierarchy(&mesh, &stream).expect("a hierarchy");
        let pairs: Pairs = stream.levels.iter().rev().flatten().map(|r| (r.vertex, r.apex)).collect();
        let r = replay(&mesh, &pairs).expect("it replays");
        let graph = graph_of(&r);
        let collapse_of = |id| {
            let node = all.node(all.find(id)?)?;
            Some(pairs.len() as u32 - 1 - (node.child - all.root_count()) / 2)
        };
        let mut free = knowing(&all);
        let mut ordered = free.clone();
        ordered.follow_order(graph.reduced().expect("an order"), collapse_of).expect("it is its order");
        assert!(matches!(
            free.clone().follow_order(ConstraintGraph::default(), collapse_of),
            Err(HierarchyError::OtherOrder { .. })
        ));
        let mut l = LocalMesh::new(mesh.vertices.len() as u32, &mesh.triangles, &pairs, graph).expect("it is in order");
        let (low, high) = mesh.bounds();
        let size = (0..3).map(|k| high[k] - low[k]).fold(0.0, f32::max);
        let mut sizes = [0, 0];
        for step in 0..12 {
            let a = step as f32;
            let eye =
                [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0 + size * [a.sin(), 0.3, a.cos()][k] * (0.5 + (a / 3.0).sin().abs()));
            let view = View::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], [0.4, 1.0, 0.004]).expect("a view");
            for front in [&mut free, &mut ordered] {
                while {
                    let done = front.refine(&view, u32::MAX).expect("a hierarchy");
                    done.splits + done.collapses > 0
                } {}
                assert!(!front.refine(&view, u32::MAX).expect("a hierarchy").wants_more);
            }
            ordered.mesh().check_invariants();
            let order = ordered.order().expect("it keeps to one");
            order.check_invariants();
            let (done, undone): (Vec<u32>, Vec<u32>) = (0..pairs.len() as u32).partition(|&i| order.is_collapsed(i));
            let splits = l.graph().split_order(&undone).expect("they are there");
            splits.iter().for_each(|&i| assert!(l.split(i).is_ok()));
            let collapses = l.graph().collapse_order(&done).expect("they are there");
            collapses.iter().for_each(|&i| assert!(l.collapse(i).is_ok()));
            assert_eq!(undone.len(), (0..pairs.len() as u32).filter(|&i| !l.graph().is_collapsed(i)).count());
            let at = |v: u32| mesh.vertices.positions[v as usize].map(f32::to_bits);
            let by_order = l.shown().iter().filter_map(|&t| l.triangle(t)).map(|t| t.map(at));
            let front = ordered.mesh().shown().iter().filter_map(|&t| ordered.mesh().triangle(t));
            let own = |v: u32| ordered.positions()[v as usize].map(f32::to_bits);
            assert_eq!(places(front.map(|t| t.map(own))), places(by_order), "{name}, step {step}");
            sizes = [sizes[0] + free.len(), sizes[1] + ordered.len()];
        }
        println!("{name}: {:.2} times the nodes by the order", sizes[1] as f64 / sizes[0] as f64);
        assert!(sizes[0] < sizes[1] && sizes[1] < 3 * sizes[0] && sizes[0] > 1000, "{sizes:?}");
    }
}

/// Triangles by where they are, each turned to begin with its lowest corner.
fn places(triangles: impl Iterator<Item = [[u32; 3]; 3]>) -> Vec<[[u32; 3]; 3]> {
    let mut all: Vec<_> = triangles.map(|[a, b, c]| [a, b, c].min([b, c, a]).min([c, a, b])).collect();
    all.sort_unstable();
    all
}

/// A front at the base mesh that knows all of a hierarchy.
fn knowing(all: &VertexHierarchy) -> Front {
    let bounds: Vec<_> = all.nodes()[..all.root_count() as usize].iter().map(|n| n.bounds).collect();
    let positions = (0..all.root_count()).map(|i| all.position(i)).collect();
    let mut front = Front::new(positions, &bounds, all.base_triangles().to_vec(), all.unit()).expect("a front");
    for (i, node) in all.nodes().iter().enumerate().filter(|(_, n)| n.child != NONE) {
        let id = all.id(i as u32).expect("a node");
        let cuts = node.cuts.map(|c| (c != NONE).then(|| all.id(c).expect("a leaf")));
        let bounds = [node.child, node.child + 1].map(|c| all.nodes()[c as usize].bounds);
        front.learn(&Split { id, cuts, position: all.position(node.child + 1), bounds }).expect("it is new");
    }
    front
}

proptest! {
    /// G.10: whatever is tried, no forbidden state is reached, and the mesh is the one that the collapses make.
    #[test]
    fn g10_random_walks_stay_within_the_order(mesh in ground(), steps in prop::collection::vec((any::<u16>(), any::<bool>()), 1..200)) {
        let (pairs, r) = collapses_of(&mesh);
        let mut l = local(&mesh, &pairs, &r);
        let mut graph = graph_of(&r);
        for (k, &(i, split)) in steps.iter().enumerate() {
            let i = u32::from(i) % (pairs.len() as u32 + 1);
            let before = shown(&l);
            let allowed = if split { graph.can_split(i) } else { graph.can_collapse(i) };
            let done = if split { l.split(i) } else { l.collapse(i) };
            prop_assert_eq!(done.is_ok(), allowed);
            if allowed {
                (if split { graph.split(i) } else { graph.collapse(i) }).expect("it is allowed");
            } else {
                prop_assert_eq!(shown(&l), before);
            }
            if k % 16 == 0 {
                check_against_a_replay(&mesh, &pairs, &r, &l);
            }
        }
        check_against_a_replay(&mesh, &pairs, &r, &l);
    }
}
