// <p-mesh>: a progressive mesh as an HTML element. What the page sees is all in the comment of PMeshElement.

import { ATTRIBUTES, PROPERTIES, parseColor, reflectAttributes } from "./pmesh-attributes.js";
import { OrbitCamera, attachControls } from "./pmesh-controls.js";
import { LevelPlayer } from "./pmesh-level-player.js";
import * as runtime from "./pmesh-runtime.js";
import { TEMPLATE } from "./pmesh-template.js";
import { ViewPlayer } from "./pmesh-view-player.js";

export { OrbitCamera };

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
  /** A LevelPlayer or a ViewPlayer: loads the model, and draws what is wanted of it. */
  #player = null;
  #controls = null;
  #resizes;
  #intersections;
  /** On screen or within 300 pixels of it. */
  #visible = false;
  #paused = false;
  #started = false;
  #lastTime = 0;
  #drawing = false;
  #progressDue = false;
  #lastError = null;
  /** Resolved at the next picture that is complete. */
  #settling = [];
  #reported = new Set();
  #background = [0, 0, 0, 0];

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
    this.#player?.stop();
    // An element that is only moved to another place keeps what the GPU has.
    queueMicrotask(() => {
      if (!this.isConnected) this.#player?.release();
    });
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
    this.#player?.release();
    this.#player?.dispose();
    this.#player = null;
    this.#started = false;
    this.#lastError = null;
    this.#part(".message").textContent = "";
    this.#part(".frame").classList.remove("shown");
  }

  #makePlayer(src) {
    const mine = (act) => (value) => this.#player === player && act(value);
    const tell = (type, detail) => this.dispatchEvent(new CustomEvent(type, { detail }));
    const told = {
      wake: mine(() => this.requestRender()),
      ready: mine((detail) => this.dispatchEvent(new CustomEvent("levelready", { detail, cancelable: true }))),
      arrived: mine(() => {
        this.#progressDue = true;
        this.#reconsider();
        this.requestRender();
      }),
      drawn: mine((detail) => tell("levelchange", detail)),
      refined: mine((detail) => {
        this.#progressDue = true;
        tell("refine", detail);
      }),
      loaded: mine(() => {
        this.#sayProgress();
        this.#say(`${this.alt || "Model"}: complete`);
        this.dispatchEvent(new CustomEvent("load"));
      }),
      warned: mine((text) => this.#report(text)),
      failed: mine((error) => this.#failed(error)),
    };
    const follows = src !== null && (this.viewDependent || ViewPlayer.plays(src));
    const player = follows ? new ViewPlayer(src, told) : new LevelPlayer(src && new URL(src, document.baseURI).href, told);
    this.#player = player;
    return player;
  }

  #start() {
    const src = this.getAttribute("src");
    if (this.#started || !src) return;
    this.#started = true;
    this.#say(`${this.alt || "Model"}: loading`);
    const player = this.#makePlayer(src);
    player.consider(!this.#paused, this.#wants());
    // The renderer compiles its shaders while the first bytes travel.
    runtime.getRenderer().catch((error) => this.#player === player && this.#failed(error));
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

  /** What the page asks of a player. */
  #wants() {
    return {
      level: this.level,
      autoLevel: this.autoLevel,
      screenError: this.screenError ?? 1,
      maxTriangles: Math.min(this.maxTriangles ?? Infinity, runtime.budgetShare(this)),
      maxMemory: this.maxMemory,
      morph: !prefersStillness(),
      frozen: this.frozen,
      view: this.#view(),
    };
  }

  /** Stops or resumes the download as what is wanted and what is visible say. */
  #reconsider() {
    if (!this.#player || !this.isConnected) return;
    // Until the first report of the observer an element counts as near.
    const hidden = !this.#visible && this.#intersectionKnown;
    this.#player.consider(!this.#paused && !hidden, this.#wants());
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
    this.#player?.restore();
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

  async #draw(time) {
    const player = this.#player;
    if (!player?.isHere || !this.#visible || this.#drawing) return;
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
    if (!renderer || this.#player !== player || !this.isConnected) return;
    const seconds = Math.min(0.1, Math.max(0, (time - this.#lastTime) / 1000));
    this.#lastTime = time;
    const turning = this.hasAttribute("auto-rotate") && !prefersStillness();
    if (turning) {
      this.camera.turn(ROTATE_SPEED * seconds, 0);
      this.requestRender();
    }
    try {
      if (!player.frame(renderer, this.#options(), this.#wants(), seconds, { element: this, context: this.#context })) return;
    } catch (error) {
      this.#failed(error);
      return;
    }
    this.#part(".frame").classList.add("shown");
    if (this.debug !== null) this.#part(".debug").textContent = player.overlay().join("\n");
    // What follows a camera that turns is never done.
    if (player.still || (turning && player.stats)) this.#settling.splice(0).forEach((resolve) => resolve());
  }

  #options() {
    const color = getComputedStyle(this).getPropertyValue("--pmesh-color").trim();
    return {
      ...this.#view(),
      background: this.#background,
      baseColor: (color && this.#parseColor(color, "--pmesh-color")) || [],
      wireframe: this.wireframe,
      representatives: this.debug === "representatives",
    };
  }

  requestRender() {
    if (this.isConnected) runtime.requestFrame(this);
  }

  // ---- the page's interface

  get info() {
    return this.#player?.info ?? null;
  }
  get shownLevel() {
    return this.#player?.shownLevel ?? null;
  }
  get levelCount() {
    return this.#player?.levelCount ?? 0;
  }
  get bytes() {
    return this.#player?.bytes ?? 0;
  }
  get complete() {
    return this.#player?.complete ?? false;
  }
  get viewStats() {
    return this.#player?.stats ?? null;
  }
  /** Levels whose geometry the last picture could use. */
  get readyLevels() {
    return this.#player?.readyLevels ?? 1;
  }
  /** The WebAssembly module's Model, once there is one. */
  get model() {
    return this.#player instanceof LevelPlayer ? this.#player.model : null;
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
    return (this.#player ?? this.#makePlayer(null)).addLevel(data);
  }

  update() {
    this.#player?.update();
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
    if (this.#player?.hasPicture && this.#visible) {
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
