//! Models by name, prepared when they are first asked for.

use crate::Config;
use pmesh_build::compact::take_apart;
use pmesh_build::hierarchy::hierarchy;
use pmesh_build::simplify::BatchOptions;
use pmesh_codec::Receiver;
use pmesh_codec::compact::seams;
use pmesh_codec::pmesh::{Quantisation, quantise};
use pmesh_core::{IndexedMesh, Vertices};
use pmesh_view::{Model, is_file, read_model};
use std::collections::HashMap;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;
use tokio::sync::{OnceCell, Semaphore};

/// Most names of a catalogue.
const NAMES_LIMIT: usize = 10_000;

type Slot = Arc<OnceCell<Result<Arc<Model>, String>>>;
/// When a file was written, and how long it is: one that changes is prepared anew.
type Stamp = (Option<SystemTime>, u64);

pub(crate) struct Models {
    folder: PathBuf,
    bits: u8,
    slots: Mutex<HashMap<PathBuf, (Stamp, Slot)>>,
    /// One at a time: preparing takes a processor, and memory.
    turn: Semaphore,
}

impl Models {
    pub(crate) fn new(config: &Config) -> Self {
        Self { folder: config.folder.clone(), bits: config.bits, slots: Mutex::default(), turn: Semaphore::new(1) }
    }

    /// The model of that name: a file of the folder, `.pmesh` added where it lacks that. Errors: in words for the client.
    pub(crate) async fn get(&self, name: &str) -> Result<Arc<Model>, String> {
        let path = self.path(name).ok_or_else(|| format!("there is no model {name:?} here"))?;
        let stamp = std::fs::metadata(&path).map_or((None, 0), |m| (m.modified().ok(), m.len()));
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let slot = slots.entry(path.clone()).or_default();
            if slot.0 != stamp {
                // Sessions that have the old one keep it.
                *slot = (stamp, Slot::default());
            }
            slot.1.clone()
        };
        let prepare = || async {
            let _turn = self.turn.acquire().await;
            let (file, bits) = (path.clone(), self.bits);
            let model = tokio::task::spawn_blocking(move || prepare(&file, bits)).await;
            let model = model.unwrap_or_else(|e| Err(format!("the model could not be prepared: {e}")));
            match &model {
                Ok(m) => tracing::info!(path = %path.display(), nodes = m.hierarchy().nodes().len(), "a model is ready"),
                Err(error) => tracing::warn!(path = %path.display(), error, "a model cannot be served"),
            }
            model
        };
        slot.get_or_init(prepare).await.clone()
    }

    /// Names of the models in the folder, and in folders in it, as far as such names are served. Errors: in words for the client.
    pub(crate) async fn names(&self) -> Result<Vec<String>, String> {
        let folder = self.folder.clone();
        // Disks are slow: others have their turn meanwhile.
        let listed = tokio::task::spawn_blocking(move || names(&folder)).await;
        listed.unwrap_or_else(|e| Err(std::io::Error::other(e))).map_err(|e| format!("the folder cannot be read: {e}"))
    }

    /// The file of a name that stays within the folder, if there is one.
    fn path(&self, name: &str) -> Option<PathBuf> {
        let name = Path::new(name.trim_start_matches('/'));
        if name.as_os_str().is_empty() || !name.components().all(|c| matches!(c, Component::Normal(_))) {
            return None;
        }
        let is_pmesh = name.extension().is_some_and(|e| e == "pmesh");
        let path = self.folder.join(if is_pmesh { name.into() } else { PathBuf::from(format!("{}.pmesh", name.display())) });
        path.is_file().then_some(path)
    }
}

fn names(folder: &Path) -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(within) = folders.pop().filter(|_| names.len() < NAMES_LIMIT) {
        for entry in std::fs::read_dir(folder.join(&within))?.flatten() {
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|n| !n.starts_with('.')) else { continue };
            let path = within.join(name);
            // A link to a folder may lead back.
            if entry.file_type().is_ok_and(|t| t.is_dir()) {
                folders.push(path);
            } else if let Some(model) = path.to_str().and_then(|p| p.strip_suffix(".pmesh")) {
                names.push(model.to_string());
            }
        }
    }
    names.sort_unstable();
    names.truncate(NAMES_LIMIT);
    Ok(names)
}

/// A `.pmesh` taken apart for views: as the file has it, or its finest mesh on the grid of `bits`, seconds for a million triangles.
fn prepare(path: &Path, bits: u8) -> Result<Arc<Model>, String> {
    let bytes = std::fs::read(path).map_err(|e| format!("the model cannot be read: {e}"))?;
    if is_file(&bytes) {
        return read_model(&bytes).map(Arc::new).map_err(|e| format!("the model cannot be read: {e}"));
    }
    let mut receiver = Receiver::default();
    receiver.push(&bytes).and_then(|()| receiver.finish()).map_err(|e| format!("the model cannot be read: {e}"))?;
    model_of(&receiver.into_mesh().finest_mesh(), Some(bits), |_| ()).map(Arc::new)
}

/// A mesh taken apart for views: its positions, on the grid of `bits` (or exact), both sides of a seam as one vertex. Some ten seconds for a million triangles; `progress` hears of the first
/// part of that. Errors: in words.
pub fn model_of(mesh: &IndexedMesh, bits: Option<u8>, progress: impl FnMut(f64)) -> Result<Model, String> {
    let mesh = welded(mesh);
    let grid = Quantisation::fit(&mesh.vertices, bits);
    let mesh = quantise(&mesh, bits);
    let stream = take_apart(mesh.clone(), bits, BatchOptions::default(), progress).map_err(|e| e.to_string())?;
    let hierarchy = hierarchy(&mesh, &stream).map_err(|e| e.to_string())?;
    Model::new(hierarchy, &mesh.triangles, grid).map_err(|e| e.to_string())
}

/// The positions and triangles of a mesh, both sides of a seam as one vertex: they hold nothing else here, and would part where views refine one side only. Vertices of
/// no triangle, and triangles without extent, are left out.
fn welded(mesh: &IndexedMesh) -> IndexedMesh {
    let mut stands: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    // Earlier ones first.
    seams(mesh).into_iter().for_each(|(v, p)| stands[v as usize] = stands[p as usize]);
    let mut number = vec![u32::MAX; stands.len()];
    let mut out = IndexedMesh { vertices: Vertices::default(), ..Default::default() };
    for t in mesh.triangles.iter().map(|t| t.map(|v| stands[v as usize])).filter(|[a, b, c]| a != b && b != c && c != a) {
        let corners = t.map(|v| {
            let n = &mut number[v as usize];
            if *n == u32::MAX {
                *n = out.vertices.positions.len() as u32;
                out.vertices.positions.push(mesh.vertices.positions[v as usize]);
            }
            *n
        });
        out.triangles.push(corners);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use pmesh_build::sample::sample;
    use std::collections::HashMap;

    #[test]
    fn a_globe_has_no_seam_here() {
        let globe = sample("globe").expect("a sample").mesh;
        let open = |m: &IndexedMesh| {
            let mut sides: HashMap<[u32; 2], i32> = HashMap::new();
            for [a, b, c] in &m.triangles {
                for (v, w) in [(a, b), (b, c), (c, a)] {
                    *sides.entry([*v.min(w), *v.max(w)]).or_default() += 1;
                }
            }
            sides.values().filter(|&&n| n == 1).count()
        };
        let whole = welded(&globe);
        assert!(open(&globe) > 100);
        assert_eq!(open(&whole), 0);
        assert!(whole.vertices.len() < globe.vertices.len() && whole.triangles.len() == globe.triangles.len());
    }
}
