// The gallery's two sides of a view: what is looked at, and all of it, with what each has cost so far.
import "./pmesh-element.js";

const byId = (id) => document.getElementById(id);
const [seen, whole] = [byId("seen"), byId("whole")];
const n = (x) => x.toLocaleString("en");

// The first of the meshes that `cargo xtask demo` was given, else a sample.
const own = await fetch("models/first-views.pmesh", { method: "HEAD" }).then((r) => r.ok, () => false);
const stem = own ? "models/first" : "samples/globe";
seen.src = `${stem}-views.pmesh`;
whole.src = `${stem}-whole.pmesh`;
document.querySelector("#views pre").textContent = `<p-mesh src="${stem}-views.pmesh" view-dependent screen-error="1" camera-controls></p-mesh>`;

let triangles = 0;
function tell() {
  const stats = seen.viewStats;
  const caption = (mesh, text) => (mesh.parentElement.querySelector("figcaption").textContent = text);
  if (stats) {
    caption(seen, `${n(stats.bytesDown)} bytes in ${n(stats.requests)} requests, ${n(stats.triangles)} triangles${stats.settled ? "" : " …"}`);
  }
  caption(whole, `${n(whole.bytes)} bytes of ${n(whole.info?.totalBytes ?? 0)}, ${n(triangles)} triangles`);
  byId("ratio").textContent = stats && whole.bytes ? `all of it takes ${(whole.bytes / stats.bytesDown).toFixed(2)} times the bytes` : "";
}
seen.addEventListener("refine", tell);
whole.addEventListener("progress", tell);
whole.addEventListener("levelchange", ({ detail }) => {
  ({ triangles } = detail);
  tell();
});

// Both are seen from the same place; frozen, the left one is looked at from elsewhere.
let last = { ...seen.camera };
function follow() {
  const changed = (camera) => ["yaw", "pitch", "zoom"].some((key) => camera[key] !== last[key]);
  const from = changed(seen.camera) ? seen : changed(whole.camera) ? whole : null;
  if (from) {
    last = { yaw: from.camera.yaw, pitch: from.camera.pitch, zoom: from.camera.zoom };
    for (const mesh of [seen, whole]) {
      Object.assign(mesh.camera, last);
      mesh.requestRender();
    }
  }
  byId("freeze").checked = seen.frozen;
  requestAnimationFrame(follow);
}
follow();

byId("freeze").addEventListener("change", ({ target }) => (seen.frozen = target.checked));
byId("edges").addEventListener("change", ({ target }) => (seen.wireframe = whole.wireframe = target.checked));
const look = (camera) => {
  seen.frozen = false;
  Object.assign(seen.camera, camera);
};
byId("near").addEventListener("click", () => look({ zoom: 8 }));
byId("home").addEventListener("click", () => look({ zoom: 1 }));
