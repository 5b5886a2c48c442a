//! Any bytes, as a stream of whatever format they look like: an error, or a mesh that keeps its invariants at every level.
//! Checksums are not looked at in a fuzzer's build.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pmesh_codec::Receiver;

fuzz_target!(|bytes: &[u8]| {
    let mut receiver = Receiver::default();
    let _ = receiver.push(bytes).and_then(|()| receiver.finish());
    let mesh = receiver.mesh();
    mesh.check_invariants();
    for level in mesh.finest_level()..mesh.level_count() {
        mesh.mesh_at(level.into()).expect("a level that has arrived").check().expect("a valid mesh");
    }
    receiver.newest_mesh().check().expect("a valid mesh");
});
