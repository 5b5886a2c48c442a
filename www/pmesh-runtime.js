// What all <p-mesh> elements of a page share: the WebAssembly module, one renderer on one OffscreenCanvas, one animation
// frame for all pictures, and the page's triangle budget. Knows nothing of attributes or events.

let modulePromise;

/** The WebAssembly module, instantiated once a page while it streams in. */
export function loadModule() {
  modulePromise ??= import("./pmesh.js").then(async (module) => {
    await module.default({ module_or_path: new URL("pmesh_bg.wasm", import.meta.url) });
    return module;
  });
  return modulePromise;
}

let rendererPromise = null;
let canvas = null;
let context = null;
let generation = 0;

/** The renderer, or a rejection with `code: "gpu"`; made again after the context was lost. */
export function getRenderer() {
  rendererPromise ??= createRenderer();
  return rendererPromise;
}

async function createRenderer() {
  const { Renderer } = await loadModule();
  const mine = new OffscreenCanvas(1, 1);
  const renderer = await Renderer.create(mine);
  canvas = mine;
  context = mine.getContext("webgl2");
  generation += 1;
  // wgpu's calls go on "succeeding" on a lost context, so everything of it is dropped and rebuilt from the models.
  mine.addEventListener("webglcontextlost", (event) => {
    event.preventDefault();
    loseRenderer(renderer, 100);
  });
  return renderer;
}

function loseRenderer(renderer, delay) {
  if (!rendererPromise) return;
  rendererPromise = null;
  canvas = context = null;
  try {
    renderer?.free();
  } catch {
    // The objects died with the context.
  }
  setTimeout(() => {
    getRenderer().then(
      () => clients.forEach((client) => client.rendererRestored()),
      () => {
        rendererPromise = null;
        // The GPU process may need a while to come back.
        if (delay < 10000) loseRendererAgain(delay * 2);
      },
    );
  }, delay);
}

function loseRendererAgain(delay) {
  rendererPromise = Promise.resolve(null);
  loseRenderer(null, delay);
}

/** The WebGL context all pictures are drawn with, for tests and diagnosis. */
export function sharedContext() {
  return context;
}

/** Counts renderers made so far: what one of them uploaded is gone with the next. */
export function rendererGeneration() {
  return generation;
}

/** Draws `model` and copies the picture to `target`, a 2D context. Gives the result, or null if the context is lost. */
export function drawTo(renderer, model, options, target) {
  return copyTo(target, options, () => renderer.draw(model, { ...options, deadline: uploadDeadline }));
}
/** The same of a ViewModel. */
export function drawViewTo(renderer, model, options, target) {
  return copyTo(target, options, () => renderer.drawView(model, options));
}

function copyTo(target, options, draw) {
  if (!canvas || !context || context.isContextLost()) return null;
  const result = draw();
  const { width, height } = options;
  if (target.canvas.width !== width) target.canvas.width = width;
  if (target.canvas.height !== height) target.canvas.height = height;
  target.clearRect(0, 0, width, height);
  target.drawImage(canvas, 0, 0, width, height, 0, 0, width, height);
  return result;
}

/** Milliseconds of a task that all elements together upload geometry for; each does a step at least. */
const UPLOAD_MS = 3;
let uploadDeadline = 0;

const uploads = new Map();
const uploadTask = new MessageChannel();
uploadTask.port1.onmessage = uploadSome;

/** Uploads what is missing of a client's model between frames, and calls for a frame once there is more to see. */
export function uploadRest(client, model) {
  if (uploads.size === 0) uploadTask.port2.postMessage(null);
  uploads.set(client, model);
}

async function uploadSome() {
  const renderer = await getRenderer().catch(() => null);
  const deadline = performance.now() + UPLOAD_MS;
  for (const [client, model] of uploads) {
    let done = !renderer || client.model !== model || !clients.has(client);
    if (!done) {
      try {
        const { complete, readyLevels } = renderer.upload(model, { wireframe: client.wireframe, deadline });
        if (complete || readyLevels > client.readyLevels) waiting.has(client) || requestFrame(client);
        done = complete;
      } catch {
        // The next picture meets the same error, and says so.
        done = true;
        requestFrame(client);
      }
    }
    if (done) uploads.delete(client);
  }
  if (uploads.size > 0) uploadTask.port2.postMessage(null);
}

const clients = new Set();
const waiting = new Set();
let frame = 0;

export function addClient(client) {
  clients.add(client);
}
/** Every element that is in the page. */
export function allClients() {
  return [...clients];
}
export function removeClient(client) {
  clients.delete(client);
  waiting.delete(client);
}

/** Calls `client.frame(time)` in the next animation frame. */
export function requestFrame(client) {
  waiting.add(client);
  if (frame) return;
  frame = requestAnimationFrame((time) => {
    frame = 0;
    const now = [...waiting];
    waiting.clear();
    uploadDeadline = performance.now() + UPLOAD_MS;
    for (const client of now) client.frame(time);
  });
}

let budget = Infinity;

/** Triangles that all elements of the page may draw together (GV99's scene-wide budget). */
export function triangleBudget() {
  return budget;
}
export function setTriangleBudget(triangles) {
  const value = triangles == null ? Infinity : Number(triangles);
  if (!(value > 0)) throw new RangeError(`triangleBudget must be a positive number, not ${triangles}`);
  budget = value;
  for (const client of clients) client.budgetChanged();
}

/** `client`'s share of the budget: by its part of all visible elements' size on screen. */
export function budgetShare(client) {
  if (budget === Infinity) return Infinity;
  let total = 0;
  for (const other of clients) total += other.visibleArea;
  return total > 0 ? (budget * client.visibleArea) / total : budget / Math.max(clients.size, 1);
}
