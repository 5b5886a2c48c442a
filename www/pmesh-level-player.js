// What <p-mesh> does with a model that arrives level by level: says what has come, morphs towards the level that is wanted, draws it.

import { decodeImage } from "./pmesh-image.js";
import { PMeshLoader } from "./pmesh-loader.js";
import * as runtime from "./pmesh-runtime.js";

/** Seconds in which a new level is morphed in. */
const MORPH_SECONDS = 0.3;

export class LevelPlayer {
  #loader;
  #tell;
  /** Finest step that may be shown: levels whose levelready was canceled wait for update(). */
  #allowedStep = -1;
  /** Finest step whose levelready has been dispatched. */
  #announcedStep = -1;
  /** Finest step whose geometry is on the GPU. */
  #readyStep = 0;
  /** Step drawn now, fractional while it morphs. */
  #shownStep = -1;
  #drawnLevel = null;
  /** The last picture showed what is wanted, with all that belongs to it. */
  #settled = false;
  #triangles = 0;
  #frameMs = 0;
  #uploadedBytes = 0;
  #imageGeneration = -1;
  #image = null;
  #imageFailed = false;
  #disposed = false;

  /**
   * `src` may be null for a model that the page makes. `tell` has wake(): draw again; ready(detail): a level has arrived, false if it is held back; arrived(): bytes have; drawn(detail): another level
   * is drawn; loaded(), warned(text), failed(error).
   */
  constructor(src, tell) {
    this.#tell = tell;
    this.#loader = new PMeshLoader(src, {
      events: (events) => this.#arrived(events),
      done: () => tell.loaded(),
      failed: tell.failed,
    });
  }

  // ---- what is here

  get model() {
    return this.#loader.model;
  }
  get info() {
    return this.model?.info ?? null;
  }
  get stats() {
    return null;
  }
  get bytes() {
    return this.model?.bytes ?? 0;
  }
  get complete() {
    return this.model?.isWhole ?? false;
  }
  get levelCount() {
    return this.model?.levelCount ?? 0;
  }
  get shownLevel() {
    return this.#drawnLevel;
  }
  /** Levels whose geometry the last picture could use. */
  get readyLevels() {
    return this.#readyStep + 1;
  }
  /** There is something to be drawn. */
  get isHere() {
    return this.model?.arrivedLevels > 0 && this.hasPicture;
  }
  /** There is a picture, or one is about to be drawn. */
  get hasPicture() {
    return this.#allowedStep >= 0;
  }
  /** The last picture was complete. */
  get still() {
    return this.#settled;
  }

  // ---- loading

  /** Something that is asked for is another than before: each frame asks anew. */
  touch() {}
  /** Loads if it `runs` and what is wanted is not here yet. */
  consider(runs, wants) {
    const model = this.model;
    const info = model?.info;
    const enough =
      info?.levels && !model.isWhole && model.arrivedLevels > 0 && model.finestLevel <= this.#wantedLevel(wants) &&
      model.bytes >= (info.textureEndByte ?? 0);
    if (runs && !enough) this.#loader.start();
    else this.#loader.stop();
  }
  stop() {
    this.#loader.stop();
  }
  dispose() {
    this.#disposed = true;
    this.#loader.dispose();
  }
  /** Frees what the GPU holds. */
  release() {
    const model = this.model;
    this.restore();
    if (model) runtime.getRenderer().then((renderer) => renderer.release(model), () => {});
  }
  /** The GPU has nothing of it. */
  restore() {
    this.#imageGeneration = -1;
    this.#readyStep = 0;
  }
  /** Shows what was held back. */
  update() {
    this.#allowedStep = this.#announcedStep;
  }
  /** Appends a level that the page made. */
  async addLevel(data) {
    const event = (await this.#loader.emptyModel()).addLevel(data);
    this.#arrived([event]);
    return event;
  }

  #arrived(events) {
    for (const event of events) {
      // A listener may have changed src.
      if (this.#disposed) return;
      if (event.type === "level") this.#levelReady(event);
      else if (event.type === "texture") this.#decodeImage(event);
      else if (event.type === "warning") this.#tell.warned(event.text);
    }
    if (!this.#disposed) this.#tell.arrived();
  }
  #levelReady(detail) {
    this.#announcedStep = detail.step;
    const go = this.#tell.ready(detail);
    // Once one is held back, later ones wait with it: levels show in order.
    if (go && this.#allowedStep === detail.step - 1) this.#allowedStep = detail.step;
  }
  async #decodeImage({ mime, bytes }) {
    try {
      const image = await decodeImage(bytes, mime, () => !this.#disposed);
      if (!image) return;
      this.#image = image;
      this.#imageGeneration = -1;
      this.#tell.wake();
    } catch (error) {
      this.#imageFailed = true;
      this.#tell.failed({ code: "bad-image", message: `the base-colour image cannot be decoded: ${error.message}` });
    }
  }
  #imageOnItsWay() {
    const end = this.info?.textureEndByte;
    if (!end || this.#image || this.#imageFailed) return false;
    return this.bytes >= end || this.#loader.running;
  }

  // ---- drawing

  /** Level that is wanted now: the page's, or the coarsest that satisfies what limits there are. */
  #wantedLevel({ level: asked, maxTriangles, autoLevel, view }) {
    const model = this.model;
    let level = Math.max(0, asked ?? 0);
    if (!model) return level;
    if (maxTriangles < Infinity) level = Math.max(level, model.levelForTriangles(maxTriangles));
    if (autoLevel !== null && asked === null) level = Math.max(level, model.levelForPixels(autoLevel, view));
    return level;
  }

  /** Moves the shown step towards the wanted one; true while it is on its way. */
  #morph(wants, seconds) {
    const model = this.model;
    const count = model.levelCount;
    // What is not on the GPU yet is not morphed to, or the morph would be over when it gets there.
    const ready = Math.max(this.#readyStep, Math.ceil(this.#shownStep));
    const newest = Math.min(this.#allowedStep, model.arrivedLevels - 1, ready);
    const wanted = Math.max(0, Math.min(newest, count - 1 - this.#wantedLevel(wants)));
    const still = wants.level !== null || this.#shownStep < 0 || !wants.morph;
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

  /** A frame of an element, in its context, `seconds` after the last one. Gives true if a picture was drawn; then frames go on until nothing changes. `wants` has level, autoLevel, maxTriangles, morph, view. */
  frame(renderer, options, wants, seconds, { element, context }) {
    const model = this.model;
    const moving = this.#morph(wants, seconds);
    const started = performance.now();
    this.#settled = false;
    this.#uploadImage(renderer, model);
    const result = runtime.drawTo(renderer, model, { ...options, shownLevel: model.levelCount - 1 - this.#shownStep }, context);
    if (!result) return false;
    this.#frameMs = performance.now() - started;
    const morphOn = result.readyLevels - 1 > this.#readyStep;
    this.#readyStep = Math.max(0, result.readyLevels - 1);
    this.#uploadedBytes = renderer.uploadedBytes;
    this.#triangles = result.triangles;
    const { level, triangles } = result;
    if (level >= 0 && level !== this.#drawnLevel) {
      this.#drawnLevel = level;
      this.#tell.drawn({ level, triangles });
    }
    if (!result.complete) runtime.uploadRest(element, model);
    if (moving || morphOn) this.#tell.wake();
    else this.#settled = result.complete && !this.#imageOnItsWay();
    return level >= 0;
  }

  #uploadImage(renderer, model) {
    if (!this.#image || this.#imageGeneration === runtime.rendererGeneration()) return;
    const { width, height, pixels } = this.#image;
    renderer.setImage(model, width, height, pixels);
    this.#imageGeneration = runtime.rendererGeneration();
  }

  /** Lines for the debug overlay. */
  overlay() {
    const total = this.info?.totalBytes;
    const n = (x) => x.toLocaleString("en");
    return [
      `bytes     ${n(this.bytes)}${total ? ` of ${n(total)}` : ""}`,
      `level     ${this.#drawnLevel.toFixed(2)} of ${this.levelCount}`,
      `triangles ${n(this.#triangles)}`,
      `frame     ${this.#frameMs.toFixed(1)} ms`,
      `uploaded  ${n(this.#uploadedBytes)} bytes`,
    ];
  }
}
