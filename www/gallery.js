// The gallery: cards for the samples and the user's models, streaming controls, and the drop zone.
import { PMeshElement } from "./pmesh-element.js";

const SAMPLES = [
  ["samples/globe.pmesh", "Globe", "fractal relief, texture coordinates with a seam, an image in the stream"],
  ["samples/marble.pmesh", "Marble body", "50,000 triangles with a colour at every vertex (after GV99, Figure 10)"],
  ["samples/knot.pmesh", "Trefoil knot", "smooth and closed, 48,000 triangles"],
  ["samples/part.pmesh", "Machined part", "flat faces and sharp edges"],
  ["samples/tetrahedra.pmesh", "Tetrahedra", "non-manifold: 64, 16, 4 triangles (after GV99, Figure 11)"],
  ["samples/figure6.lod", "Figure 6", "the text file printed in GV99, two-dimensional"],
];

const byId = (id) => document.getElementById(id);
const cards = [];

function withRate(url) {
  const rate = byId("rate").value;
  return rate && !url.startsWith("blob:") ? `${url}?rate=${rate}` : url;
}

function addCard(url, title, what, first = false) {
  const card = document.createElement("article");
  card.innerHTML = `<h2></h2><p class="what"></p><p-mesh camera-controls></p-mesh>
    <progress max="1" value="0"></progress>
    <div class="row"><button type="button" class="stream">Pause</button>
    <input type="range" class="slider" min="0" max="1" step="0.05" value="0" aria-label="Level of detail">
    <button type="button" class="newest">newest</button></div>
    <div class="level"></div><pre></pre>`;
  card.querySelector("h2").textContent = title;
  card.querySelector(".what").textContent = what;
  const mesh = card.querySelector("p-mesh");
  const [bar, slider, level] = ["progress", ".slider", ".level"].map((s) => card.querySelector(s));
  const stream = card.querySelector(".stream");
  mesh.alt = title;
  const file = url.startsWith("blob:") ? "your-model.pmesh" : url;
  if (url.startsWith("blob:")) {
    const save = Object.assign(document.createElement("a"), { href: url, textContent: "Save the stream" });
    save.download = /\.(pmesh|pits|pfs|slod|lod|gz|wrl|x3dv?)$/i.test(title) ? title : `${title.replace(/\.[^.]*$/, "")}.pmesh`;
    card.querySelector(".what").append(" · ", save);
  }
  const showTag = () => {
    const chosen = mesh.level === null ? "" : ` level="${mesh.level}"`;
    card.querySelector("pre").textContent = `<p-mesh src="${file}" alt="${title}" camera-controls${chosen}></p-mesh>`;
  };
  mesh.addEventListener("progress", ({ detail }) => {
    if (detail.totalBytes) bar.value = detail.bytes / detail.totalBytes;
  });
  mesh.addEventListener("levelready", () => {
    slider.max = Math.max(1, mesh.levelCount - 1);
  });
  mesh.addEventListener("levelchange", ({ detail }) => {
    level.textContent = `level ${detail.level.toFixed(2)}, ${detail.triangles.toLocaleString("en")} triangles`;
    if (mesh.level === null) slider.value = slider.max - detail.level;
  });
  mesh.addEventListener("load", () => {
    bar.value = 1;
    stream.disabled = true;
  });
  mesh.addEventListener("error", ({ detail }) => {
    level.textContent = detail.message;
  });
  // The slider runs from coarse to fine.
  slider.addEventListener("input", () => {
    mesh.level = Number((slider.max - slider.value).toFixed(2));
    showTag();
  });
  card.querySelector(".newest").addEventListener("click", () => {
    mesh.level = null;
    showTag();
  });
  let paused = false;
  stream.addEventListener("click", () => {
    paused = !paused;
    if (paused) mesh.pause();
    else mesh.play();
    stream.textContent = paused ? "Play" : "Pause";
  });
  const start = () => {
    bar.value = 0;
    level.textContent = "";
    paused = false;
    mesh.play();
    Object.assign(stream, { disabled: false, textContent: "Pause" });
    mesh.removeAttribute("src");
    mesh.src = withRate(url);
  };
  showTag();
  byId("gallery")[first ? "prepend" : "append"](card);
  cards.push({ mesh, start });
  applyOptions();
  start();
  return card;
}

function applyOptions() {
  for (const { mesh } of cards) {
    mesh.wireframe = byId("wireframe").checked;
    mesh.debug = byId("representatives").checked ? "representatives" : byId("overlay").checked;
  }
}
for (const id of ["wireframe", "overlay", "representatives"]) byId(id).addEventListener("change", applyOptions);
byId("restart").addEventListener("click", () => cards.forEach((card) => card.start()));
byId("rate").addEventListener("change", () => cards.forEach((card) => card.start()));
byId("budget").addEventListener("change", ({ target }) => {
  PMeshElement.triangleBudget = target.value ? Math.max(1, Number(target.value)) : null;
});

function showOwn(bytes, name) {
  const url = URL.createObjectURL(new Blob([bytes]));
  const card = addCard(url, name, `${bytes.byteLength.toLocaleString("en")} bytes`, true);
  card.scrollIntoView({ behavior: "smooth", block: "nearest" });
}

async function encodeFile(file) {
  const bytes = await file.arrayBuffer();
  if (/\.(pmesh|pits|pfs|slod|lod|gz|wrl|x3dv?)$/i.test(file.name)) return showOwn(bytes, file.name);
  const [bar, message] = [byId("encoding"), byId("message")];
  bar.hidden = false;
  bar.value = 0;
  message.textContent = `encoding ${file.name} …`;
  const worker = new Worker(new URL("encode-worker.js", import.meta.url), { type: "module" });
  const warnings = [];
  const finish = (text) => {
    worker.terminate();
    bar.hidden = true;
    message.textContent = text;
  };
  worker.onerror = (event) => finish(`the encoder cannot be loaded: ${event.message ?? "see the console"}`);
  worker.onmessage = ({ data }) => {
    if ("progress" in data) bar.value = data.progress;
    if (data.warning) warnings.push(data.warning);
    if (data.error) finish(data.error);
    if (data.stream) {
      finish([`${file.name} is encoded.`, ...warnings].join(" "));
      showOwn(data.stream, file.name);
    }
  };
  worker.postMessage({ name: file.name, bytes, bits: 14 }, [bytes]);
}

const drop = byId("drop");
for (const type of ["dragover", "dragleave", "drop"]) {
  document.addEventListener(type, (event) => {
    event.preventDefault();
    drop.classList.toggle("over", type === "dragover");
    const file = type === "drop" && event.dataTransfer.files[0];
    if (file) encodeFile(file);
  });
}
byId("file").addEventListener("change", ({ target }) => target.files[0] && encodeFile(target.files[0]));
drop.addEventListener("keydown", (event) => {
  if (event.target === drop && (event.key === "Enter" || event.key === " ")) byId("file").click();
});

for (const [url, title, what] of SAMPLES) addCard(url, title, what);
const own = await fetch("models/index.json").then((r) => (r.ok ? r.json() : []), () => []);
for (const name of own.toReversed()) addCard(`models/${name}`, name.replace(/^\d+-|\.pmesh$/g, ""), "encoded by cargo xtask demo", true);
