// <p-mesh>: a progressive mesh as an HTML element. What the page sees is all in the comment of PMeshElement.

import { ATTRIBUTES, PROPERTIES, parseColor, reflectAttributes } from "./pmesh-attributes.js";
import { OrbitCamera, attachControls } from "./pmesh-controls.js";
import { decodeImage } from "./pmesh-image.js";
import { PMeshLoader } from "./pmesh-loader.js";
import * as runtime from "./pmesh-runtime.js";
import { TEMPLATE } from "./pmesh-template.js";
import { ViewPlayer } from "./pmesh-view-player.js";

export { OrbitCamera };

/** Seconds in which a new level is morphed in. */
const MORPH_SECONDS = 0.3;
/** Largest side of a picture, device pixels. */
const MAX_PIXELS = 4096;
/** Radians a second of auto-rotate. */
const ROTATE_SPEED = 0.5;

function prefersStillness() {
  return matchMedia("(prefers-reduced-motion: reduce)").matches;
}

/**
 * A 3D model that shows at once and sharpens while it arrives.
 *
 * @element p-mesh
 *
 * @attr {string} src - URL of a stream of any kind. Changing it aborts the download before.
 * @attr {number} level - Level of detail to show: 0 is the finest, fractions morph. Without it the newest shows.
 *   Kept until it has arrived; the nearest that is there shows meanwhile. Downloading stops once it is reached.
 * @attr {number} max-triangles - Show, and download, no level of more triangles than this, whatever level asks for (the
 *   coarsest is always shown). Text streams announce no sizes: of them all is downloaded.
 * @attr {number} auto-level - Pixels of geometric error allowed: levels finer than that are neither shown nor downloaded,
 *   unless level asks for one.
 * @attr {boolean} view-dependent - src is a file that is refined where it is looked at (`pmesh encode --profile views`): what the camera sees is
 *   fetched by range requests. So is a model whose src is the ws: or wss: address of `pmesh serve`, by a session. level, auto-level and level
 *   events do not apply to such models; max-triangles bounds what is shown, by a larger error.
 * @attr {number} screen-error - Of such a model: pixels that what is seen may be off by; 1 by default.
 * @attr {number} max-memory - Of such a model: megabytes that what is known may take (of a file up to half a megabyte more); what is not
 *   shown is forgotten first.
 * @attr {boolean} frozen - Such a model stays as it is while the camera moves on; the F key switches it with camera-controls.
 * @attr {boolean} camera-controls - Turn and zoom by mouse, touch, wheel and keyboard (arrows, + and -, Home).
 * @attr {boolean} auto-rotate - Turn slowly; not under prefers-reduced-motion.
 * @attr {boolean} wireframe - Draw the edges over the faces.
 * @attr {string} background - A CSS colour; transparent by default.
 * @attr {string} alt - What the model shows, for those who cannot see it.
 * @attr {string} poster - URL of an image to show until the model does.
 * @attr {"eager"|"lazy"} loading - lazy begins only near the visible part of the page.
 * @attr {""|"representatives"} debug - An overlay with bytes, level, triangles and frame time; with "representatives"
 *   faces are coloured by the vertex that stands for them in the coarsest level.
 * Every attribute is a property too, in camel case (maxTriangles, autoLevel, cameraControls, autoRotate). Values that are
 * not understood are reported on the console.
 *
 * @prop {StreamInfo|null} info - The stream's header with its level table. Read only.
 * @prop {number|null} shownLevel - Level that is drawn now. Read only.
 * @prop {number} levelCount - Levels in all, as far as known. Read only.
 * @prop {number} bytes - Bytes received. Read only.
 * @prop {boolean} complete - True once every byte has arrived. Read only.
 * @prop {RefineDetail|null} viewStats - Of a model that is refined where it is looked at: as in the refine event. Read only.
 * @prop {OrbitCamera} camera - yaw, pitch, zoom; call requestRender() after changing them.
 * @prop {number} PMeshElement.triangleBudget - Static: triangles that all elements may draw together, shared out by their
 *   size on screen; Infinity by default.
 *
 * @method setLevel - setLevel(level: number|null): as the level property; throws a RangeError if it is not a number.
 * @method addLevel - addLevel(data: LevelData): Promise<LevelReady>: appends a level that the page made, to an element
 *   without src.
 * @method update - Shows levels whose levelready event was canceled.
 * @method pause - Stops downloading; what is there stays.
 * @method play - Goes on downloading where it stopped.
 * @method toBlob - toBlob(type = "image/png", quality?): Promise<Blob>: the picture, once it is complete.
 * @method requestRender - Draws again in the next frame.
 *
 * @fires levelready - Once for each level, in order, when it has arrived: detail has step, level, levelCount (or null),
 *   vertices, triangles, bytes, error (or null). Canceled (preventDefault), the level shows only after update().
 * @fires levelchange - The level drawn is another: detail has level and triangles.
 * @fires progress - Bytes arrived: detail has bytes and totalBytes (or null). At most once a frame.
 * @fires refine - A model that is refined where it is looked at has changed, at most once a frame: detail has front (vertices), triangles,
 *   known and total (nodes), splits, splitsPerSecond, bytesUp, bytesDown, requests, memoryBytes, evictions, coarser (times the error asked for), connected,
 *   connections, and settled: nothing changes any more until the camera moves.
 * @fires load - Every byte has arrived.
 * @fires error - Loading or drawing failed: detail has code and message. What had arrived stays; where nothing had, the
 *   message shows. Canceled (preventDefault), it is not reported on the console. Codes: http, network,
 *   server and other-model (of a view server), gpu, too-large (for a texture of this GPU), bad-image, internal, and a decoder's: unknown-format, newer-version, syntax,
 *   truncated, checksum, limit, invalid-mesh.
 *
 * @cssprop --pmesh-color - Colour of models that have none.
 * @csspart canvas - The picture.
 * @csspart poster - The poster image.
 * @csspart debug - The debug overlay.
 * @csspart message - What went wrong, where nothing can be shown.
 * @slot - What to show until the first picture, and where the model cannot be shown.
 */
export class PMeshElement extends HTMLElement {
  static observedAttributes = ATTRIBUTES;

  static get triangleBudget() {
    return runtime.triangleBudget();
  }
  static set triangleBudget(triangles) {
    runtime.setTriangleBudget(triangles);
  }

  camera = new OrbitCamera();

  #root;
  #canvas;
  #context;
  #loader = null;
  /** Instead of a loader, for models that are refined where they are looked at. */
  #player = null;
  #controls = null;
  #resizes;
  #intersections;
  /** On screen or within 300 pixels of it. */
  #visible = false;
  #paused = false;
  #started = false;
  /** Finest step that may be shown: levels whose levelready was canceled wait for update(). */
  #allowedStep = -1;
  /** Finest step whose levelready has been dispatched. */
  #announcedStep = -1;
  /** Finest step whose geometry is on the GPU. */
  #readyStep = 0;
  /** Step drawn now, fractional while it morphs. */
  #shownStep = -1;
  #drawnLevel = null;
  #lastTime = 0;
  #frameMs = 0;
  #drawing = false;
  #progressDue = false;
  #lastError = null;
  /** Resolved at the next picture that is complete. */
  #settling = [];
  #reported = new Set();
  #background = [0, 0, 0, 0];
  #imageGeneration = -1;
  #image = null;
  #imageFailed = false;

  constructor() {
    super();
    this.#root = this.attachShadow({ mode: "open", delegatesFocus: true });
    this.#root.append(TEMPLATE.content.cloneNode(true));
    this.#canvas = this.#part("canvas");
    this.#context = this.#canvas.getContext("2d");
    this.#resizes = new ResizeObserver(() => this.#shareBudget());
    this.#intersections = new IntersectionObserver((entries) => this.#intersected(entries.at(-1)), { rootMargin: "300px" });
  }

  #part(selector) {
    return this.#root.querySelector(selector);
  }

  // ---- life cycle

  connectedCallback() {
    // Properties that were set before the element was defined hide the accessors: set them again.
    for (const name of PROPERTIES) {
      if (!Object.hasOwn(this, name)) continue;
      const value = this[name];
      delete this[name];
      this[name] = value;
    }
    runtime.addClient(this);
    this.#resizes.observe(this);
    this.#intersections.observe(this);
    this.#describe();
    if (this.loading !== "lazy") this.#start();
    this.#reconsider();
  }

  disconnectedCallback() {
    this.#resizes.disconnect();
    this.#intersections.disconnect();
    this.#visible = this.#intersectionKnown = false;
    runtime.removeClient(this);
    this.#shareBudget();
    this.#loader?.stop();
    this.#player?.stop();
    // An element that is only moved to another place keeps what the GPU has.
    queueMicrotask(() => {
      if (!this.isConnected) this.#release();
    });
  }

  #release() {
    const model = this.#loader?.model;
    this.#imageGeneration = -1;
    this.#readyStep = 0;
    if (model) runtime.getRenderer().then((renderer) => renderer.release(model), () => {});
    this.#player?.release();
  }

  attributeChangedCallback(name, before, now) {
    if (before === now) return;
    switch (name) {
      case "src": case "view-dependent":
        // An address says so itself.
        if (name === "view-dependent" && ViewPlayer.plays(this.src)) break;
        this.#reset();
        if (this.isConnected && (this.loading !== "lazy" || this.#visible)) this.#start();
        break;
      case "level": case "max-triangles": case "auto-level": case "screen-error": case "max-memory":
        if (now !== null && Number.isNaN(Number.parseFloat(now))) this.#report(`${name}="${now}" is not a number`);
        else if (name !== "level" && Number.parseFloat(now) < 0) this.#report(`${name}="${now}" is less than nothing`);
        this.#player?.touch();
        this.#reconsider();
        break;
      case "camera-controls":
        this.#controls?.abort();
        this.#controls = null;
        if (now !== null) {
          this.#controls = new AbortController();
          const freeze = () => (this.frozen = !this.frozen);
          attachControls(this.#canvas, this.camera, () => this.requestRender(), this.#controls.signal, { f: freeze, F: freeze });
        }
        this.#describe();
        break;
      case "background":
        this.#background = this.#parseColor(now ?? "transparent", "background") ?? this.#background;
        break;
      case "alt":
        this.#describe();
        break;
      case "poster": {
        const image = this.#part(".poster");
        image.hidden = now === null;
        if (now === null) image.removeAttribute("src");
        else image.src = now;
        break;
      }
      case "loading":
        if (now !== null && now !== "lazy" && now !== "eager") this.#report(`loading="${now}" is neither lazy nor eager`);
        if (this.isConnected && now !== "lazy") this.#start();
        break;
      case "debug":
        this.#part(".debug").hidden = now === null;
        if (now !== null && now !== "" && now !== "representatives") this.#report(`debug="${now}" is not known`);
        break;
    }
    this.requestRender();
  }

  #report(text) {
    // Once is enough: some values are looked at in every frame.
    if (this.#reported.has(text)) return;
    this.#reported.add(text);
    console.warn(`<p-mesh>: ${text}`);
  }
  #parseColor(text, name) {
    const color = parseColor(text);
    if (!color) this.#report(`${name}: "${text}" is not a colour`);
    return color;
  }
  #describe() {
    const interactive = this.hasAttribute("camera-controls");
    this.#canvas.setAttribute("role", interactive ? "application" : "img");
    this.#canvas.setAttribute("aria-label", this.alt || "3D model");
    if (interactive) {
      this.#canvas.tabIndex = 0;
      this.#canvas.setAttribute("aria-description", "Arrow keys turn the model, plus and minus zoom, Home resets.");
    } else {
      this.#canvas.removeAttribute("tabindex");
      this.#canvas.removeAttribute("aria-description");
    }
  }
  #say(text) {
    const status = this.#part(".status");
    if (status.textContent !== text) status.textContent = text;
  }

  // ---- loading

  #reset() {
    this.#release();
    this.#loader?.dispose();
    this.#player?.dispose();
    this.#loader = this.#player = null;
    this.#started = false;
    this.#allowedStep = this.#announcedStep = this.#shownStep = -1;
    this.#readyStep = 0;
    this.#drawnLevel = null;
    this.#image = this.#lastError = null;
    this.#imageFailed = false;
    this.#part(".message").textContent = "";
    this.#part(".frame").classList.remove("shown");
  }

  #makeLoader(src) {
    const loader = new PMeshLoader(src, {
      events: (events) => this.#loader === loader && this.#arrived(events),
      done: () => {
        if (this.#loader !== loader) return;
        this.#sayProgress();
        this.#say(`${this.alt || "Model"}: complete`);
        this.dispatchEvent(new CustomEvent("load"));
      },
      failed: (error) => this.#loader === loader && this.#failed(error),
    });
    this.#loader = loader;
    return loader;
  }

  #makePlayer(src) {
    const mine = (act) => (value) => this.#player === player && act(value);
    const player = new ViewPlayer(src, {
      wake: mine(() => this.requestRender()),
      refined: mine((detail) => {
        this.#progressDue = true;
        this.dispatchEvent(new CustomEvent("refine", { detail }));
      }),
      loaded: mine(() => this.dispatchEvent(new CustomEvent("load"))),
      failed: mine((error) => this.#failed(error)),
    });
    this.#player = player;
    return player;
  }

  #start() {
    const src = this.getAttribute("src");
    if (this.#started || !src) return;
    this.#started = true;
    this.#say(`${this.alt || "Model"}: loading`);
    if (this.viewDependent || ViewPlayer.plays(src)) {
      const player = this.#makePlayer(src);
      if (!this.#paused) player.start();
      runtime.getRenderer().catch((error) => this.#player === player && this.#failed(error));
      return;
    }
    const loader = this.#makeLoader(new URL(src, document.baseURI).href);
    if (!this.#paused) loader.start();
    // The renderer compiles its shaders while the first bytes travel.
    runtime.getRenderer().catch((error) => this.#loader === loader && this.#failed(error));
  }

  #failed(error) {
    const code = error?.code ?? "internal";
    const message = error?.message ?? String(error);
    // One cause may reach us by two ways, such as a module that does not compile.
    if (this.#lastError === message) return;
    this.#lastError = message;
    this.#say(`${this.alt || "Model"}: ${message}`);
    this.#part(".message").textContent = `${this.alt || "3D model"}: ${message}`;
    const unheard = this.dispatchEvent(new CustomEvent("error", { detail: { code, message }, cancelable: true }));
    if (unheard) this.#report(`${this.getAttribute("src") ?? "a model"}: ${message}`);
    this.requestRender();
  }

  #arrived(events) {
    const loader = this.#loader;
    for (const event of events) {
      // A listener may have changed src.
      if (this.#loader !== loader) return;
      if (event.type === "level") this.#levelReady(event);
      else if (event.type === "texture") this.#decodeImage(event);
      else if (event.type === "warning") this.#report(event.text);
    }
    this.#progressDue = true;
    this.#reconsider();
    this.requestRender();
  }

  #levelReady(detail) {
    this.#announcedStep = detail.step;
    const go = this.dispatchEvent(new CustomEvent("levelready", { detail, cancelable: true }));
    // Once one is held back, later ones wait with it: levels show in order.
    if (go && this.#allowedStep === detail.step - 1) this.#allowedStep = detail.step;
  }

  async #decodeImage({ mime, bytes }) {
    const loader = this.#loader;
    try {
      const image = await decodeImage(bytes, mime, () => this.#loader === loader);
      if (!image) return;
      this.#image = image;
      this.#imageGeneration = -1;
      this.requestRender();
    } catch (error) {
      if (this.#loader !== loader) return;
      this.#imageFailed = true;
      this.#failed({ code: "bad-image", message: `the base-colour image cannot be decoded: ${error.message}` });
    }
  }

  #imageOnItsWay() {
    const end = this.info?.textureEndByte;
    if (!end || this.#image || this.#imageFailed) return false;
    return this.bytes >= end || this.#loader.running;
  }

  /** Level that is wanted now: the page's, or the coarsest that satisfies what limits there are. */
  #wantedLevel() {
    const model = this.#loader?.model;
    let level = Math.max(0, this.level ?? 0);
    if (!model) return level;
    const limit = Math.min(this.maxTriangles ?? Infinity, runtime.budgetShare(this));
    if (limit < Infinity) level = Math.max(level, model.levelForTriangles(limit));
    if (this.autoLevel !== null && this.level === null) level = Math.max(level, model.levelForPixels(this.autoLevel, this.#view()));
    return level;
  }

  /** Stops or resumes the download as what is wanted and what is visible say. */
  #reconsider() {
    const loader = this.#loader;
    if (this.#player && this.isConnected) {
      if (this.#paused || (!this.#visible && this.#intersectionKnown)) this.#player.stop();
      else this.#player.start();
      return;
    }
    if (!loader || !this.isConnected) return;
    const model = loader.model;
    const info = model?.info;
    const enough =
      info?.levels && !model.isWhole && model.arrivedLevels > 0 && model.finestLevel <= this.#wantedLevel() &&
      model.bytes >= (info.textureEndByte ?? 0);
    // Until the first report of the observer an element counts as near.
    const hidden = !this.#visible && this.#intersectionKnown;
    if (this.#paused || enough || hidden) loader.stop();
    else loader.start();
  }
  #intersectionKnown = false;

  #intersected(entry) {
    this.#intersectionKnown = true;
    this.#visible = entry.isIntersecting;
    if (this.#visible) this.#start();
    this.#shareBudget();
  }

  /** Tells all elements that one of them takes another part of the screen. */
  #shareBudget() {
    for (const client of runtime.allClients()) client.budgetChanged();
    this.requestRender();
  }

  // ---- called by the runtime

  get visibleArea() {
    return this.#visible ? this.clientWidth * this.clientHeight : 0;
  }
  budgetChanged() {
    this.#reconsider();
    this.requestRender();
  }
  rendererRestored() {
    this.#imageGeneration = -1;
    this.#readyStep = 0;
    this.requestRender();
  }

  frame(time) {
    if (!this.isConnected) return;
    // Size and camera may have changed what is wanted.
    this.#reconsider();
    this.#sayProgress();
    this.#draw(time);
  }
  #sayProgress() {
    if (!this.#progressDue) return;
    this.#progressDue = false;
    const totalBytes = this.info?.totalBytes ?? null;
    this.dispatchEvent(new CustomEvent("progress", { detail: { bytes: this.bytes, totalBytes } }));
  }

  // ---- drawing

  #view() {
    // Larger pictures than every GPU can draw are drawn smaller and stretched.
    const largest = Math.max(this.clientWidth, this.clientHeight, 1);
    const ratio = Math.min(window.devicePixelRatio || 1, MAX_PIXELS / largest);
    const width = Math.max(1, Math.round(this.clientWidth * ratio));
    const height = Math.max(1, Math.round(this.clientHeight * ratio));
    const { yaw, pitch, zoom } = this.camera;
    return { width, height, yaw, pitch, zoom };
  }

  /** Moves the shown step towards the wanted one; true while it is on its way. */
  #morph(seconds) {
    const model = this.#loader.model;
    const count = model.levelCount;
    // What is not on the GPU yet is not morphed to, or the morph would be over when it gets there.
    const ready = Math.max(this.#readyStep, Math.ceil(this.#shownStep));
    const newest = Math.min(this.#allowedStep, model.arrivedLevels - 1, ready);
    const wanted = Math.max(0, Math.min(newest, count - 1 - this.#wantedLevel()));
    const still = this.level !== null || this.#shownStep < 0 || prefersStillness();
    if (still) {
      this.#shownStep = wanted;
      return false;
    }
    const left = wanted - this.#shownStep;
    // At least a step a MORPH_SECONDS; all that is left within one, however many came at once.
    const step = (Math.max(1, Math.abs(left)) * seconds) / MORPH_SECONDS;
    this.#shownStep = Math.abs(left) <= step ? wanted : this.#shownStep + Math.sign(left) * step;
    return this.#shownStep !== wanted;
  }

  async #draw(time) {
    const model = this.#loader?.model;
    const player = this.#player;
    const something = player ? player.model : model && model.arrivedLevels > 0 && this.#allowedStep >= 0;
    if (!something || !this.#visible || this.#drawing) return;
    let renderer;
    this.#drawing = true;
    try {
      renderer = await runtime.getRenderer();
    } catch (error) {
      this.#failed(error);
      return;
    } finally {
      this.#drawing = false;
    }
    if (!renderer || this.#loader?.model !== model || this.#player !== player || !this.isConnected) return;
    const seconds = Math.min(0.1, Math.max(0, (time - this.#lastTime) / 1000));
    this.#lastTime = time;
    const turning = this.hasAttribute("auto-rotate") && !prefersStillness();
    if (turning) this.camera.turn(ROTATE_SPEED * seconds, 0);
    if (player) {
      this.#drawView(renderer, player, turning);
      if (turning) this.requestRender();
      return;
    }
    const moving = this.#morph(seconds);
    const started = performance.now();
    let result;
    try {
      this.#uploadImage(renderer, model);
      result = runtime.drawTo(renderer, model, this.#options(model), this.#context);
    } catch (error) {
      this.#failed(error);
      return;
    }
    if (!result) return;
    this.#frameMs = performance.now() - started;
    const morphOn = result.readyLevels - 1 > this.#readyStep;
    this.#readyStep = Math.max(0, result.readyLevels - 1);
    if (result.level >= 0) this.#drawn(result, renderer);
    if (!result.complete) runtime.uploadRest(this, model);
    if (moving || morphOn) this.requestRender();
    if (moving || morphOn || !result.complete) return;
    if (!this.#imageOnItsWay()) this.#settling.splice(0).forEach((resolve) => resolve());
    if (turning) this.requestRender();
  }

  #drawView(renderer, player, turning) {
    const limits = {
      screenError: this.screenError ?? 1,
      maxTriangles: Math.min(this.maxTriangles ?? Infinity, runtime.budgetShare(this)),
      maxMemory: this.maxMemory,
      morph: !prefersStillness(),
    };
    try {
      if (!player.frame(renderer, this.#options(null), limits, this.frozen, this.#context)) return;
    } catch (error) {
      player.stop();
      this.#failed(error);
      return;
    }
    this.#part(".frame").classList.add("shown");
    if (this.debug !== null) this.#part(".debug").textContent = player.overlay(this.frozen).join("\n");
    if (player.still || this.frozen || turning) this.#settling.splice(0).forEach((resolve) => resolve());
  }

  #options(model) {
    const color = getComputedStyle(this).getPropertyValue("--pmesh-color").trim();
    return {
      ...this.#view(),
      background: this.#background,
      baseColor: (color && this.#parseColor(color, "--pmesh-color")) || [],
      wireframe: this.wireframe,
      representatives: this.debug === "representatives",
      shownLevel: model ? model.levelCount - 1 - this.#shownStep : undefined,
    };
  }

  #uploadImage(renderer, model) {
    if (!this.#image || this.#imageGeneration === runtime.rendererGeneration()) return;
    const { width, height, pixels } = this.#image;
    renderer.setImage(model, width, height, pixels);
    this.#imageGeneration = runtime.rendererGeneration();
  }

  #drawn({ level, triangles }, renderer) {
    this.#part(".frame").classList.add("shown");
    if (level !== this.#drawnLevel) {
      this.#drawnLevel = level;
      this.dispatchEvent(new CustomEvent("levelchange", { detail: { level, triangles } }));
    }
    if (this.debug !== null) {
      const total = this.info?.totalBytes;
      this.#part(".debug").textContent = [
        `bytes     ${this.bytes.toLocaleString("en")}${total ? ` of ${total.toLocaleString("en")}` : ""}`,
        `level     ${level.toFixed(2)} of ${this.levelCount}`,
        `triangles ${triangles.toLocaleString("en")}`,
        `frame     ${this.#frameMs.toFixed(1)} ms`,
        `uploaded  ${renderer.uploadedBytes.toLocaleString("en")} bytes`,
      ].join("\n");
    }
  }

  requestRender() {
    if (this.isConnected) runtime.requestFrame(this);
  }

  // ---- the page's interface

  get info() {
    return this.#loader?.model?.info ?? null;
  }
  get shownLevel() {
    return this.#drawnLevel;
  }
  get levelCount() {
    return this.#loader?.model?.levelCount ?? 0;
  }
  get bytes() {
    return this.#loader?.model?.bytes ?? this.#player?.stats?.bytesDown ?? 0;
  }
  get complete() {
    return this.#loader?.model?.isWhole ?? this.#player?.model?.hasAll ?? false;
  }
  get viewStats() {
    return this.#player?.stats ?? null;
  }
  /** Levels whose geometry the last picture could use. */
  get readyLevels() {
    return this.#readyStep + 1;
  }
  /** The WebAssembly module's Model, once there is one. */
  get model() {
    return this.#loader?.model ?? null;
  }

  setLevel(level) {
    if (level !== null && (typeof level !== "number" || Number.isNaN(level))) {
      throw new RangeError(`a level is a number or null, not ${level}`);
    }
    this.level = level;
  }

  async addLevel(data) {
    await runtime.loadModule();
    if (this.getAttribute("src")) {
      throw Object.assign(new Error("an element with src plays its stream: add levels to one without"), { code: "bad-level" });
    }
    const loader = this.#loader ?? this.#makeLoader(null);
    const event = (await loader.emptyModel()).addLevel(data);
    this.#arrived([event]);
    return event;
  }

  update() {
    this.#allowedStep = this.#announcedStep;
    this.requestRender();
  }
  pause() {
    this.#paused = true;
    this.#reconsider();
  }
  play() {
    this.#paused = false;
    this.#reconsider();
  }

  async toBlob(type = "image/png", quality = undefined) {
    if ((this.#allowedStep >= 0 || this.#player?.stats) && this.#visible) {
      // The next picture with nothing on its way.
      await new Promise((resolve) => {
        this.#settling.push(resolve);
        this.requestRender();
      });
    }
    return new Promise((resolve, reject) => {
      const done = (blob) => (blob ? resolve(blob) : reject(new Error(`the browser cannot write ${type}`)));
      this.#canvas.toBlob(done, type, quality);
    });
  }
}

reflectAttributes(PMeshElement.prototype);
if (!customElements.get("p-mesh")) customElements.define("p-mesh", PMeshElement);
