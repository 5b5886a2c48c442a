// What <p-mesh> does with a model that is refined where it is looked at: follows the camera frame by frame, draws the front, counts.

import * as runtime from "./pmesh-runtime.js";
import { PMeshRanges } from "./pmesh-ranges.js";
import { PMeshViews } from "./pmesh-views.js";

/** Milliseconds of a frame in which the front is looked through: a third where pictures take long to draw, within limits. */
const FOLLOW_MS = { least: 5, most: 30 };
const FOLLOW_PART = 1 / 3;
/** Pixels by which a vertex moves in a frame: none is seen to jump. */
const MORPH_PIXELS = 1;
/** Milliseconds that the first picture waits for what its view needs: what nobody has seen yet can be where it belongs at once. */
const FIRST_PICTURE_MS = 250;
/** Milliseconds over which splits a second are counted. */
const RATE_MS = 1000;
const BYTES_A_MEGABYTE = 1e6;

export class ViewPlayer {
  #views;
  #tell;
  #stats = null;
  #settled = false;
  /** Nothing changes until something arrives. */
  #rests = false;
  /** Since when there has been something to draw, and whether it has been drawn. */
  #since = null;
  #drawn = false;
  #loaded = false;
  /** Times and counts of splits, for the rate. */
  #rate = [];
  #frozen = false;
  #frameMs = 0;

  /** `tell` has wake(): draw again; refined(stats), loaded(), failed(error). */
  constructor(src, tell) {
    this.#tell = tell;
    const Transport = PMeshViews.speaks(src) ? PMeshViews : PMeshRanges;
    this.#views = new Transport(src, {
      arrived: () => {
        this.#settled = this.#rests = false;
        tell.wake();
      },
      failed: tell.failed,
    });
  }

  /** Something that is asked for is another than before. */
  touch() {
    this.#settled = this.#rests = false;
    if (this.#stats) this.#stats = { ...this.#stats, settled: false };
  }
  /** True for addresses of servers of views; files are told by an attribute. */
  static plays(src) {
    return PMeshViews.speaks(src);
  }

  get model() {
    return this.#views.model;
  }
  /** What is here and what it took; null before anything is. */
  get stats() {
    return this.#stats;
  }
  /** The picture stays as it is: nothing is missing, or nobody is there to ask. */
  get still() {
    return this.#frozen || this.#settled || (this.#rests && !this.#views.connected);
  }
  /** Nothing of levels here. */
  get info() {
    return null;
  }
  get shownLevel() {
    return null;
  }
  get levelCount() {
    return 0;
  }
  get readyLevels() {
    return 1;
  }
  update() {}
  get bytes() {
    return this.#stats?.bytesDown ?? 0;
  }
  get complete() {
    return this.model?.hasAll ?? false;
  }
  /** There is something to be drawn. */
  get isHere() {
    return Boolean(this.model);
  }
  /** There is a picture, or one is about to be drawn. */
  get hasPicture() {
    return this.#stats !== null;
  }
  /** Loads what a view needs if it `runs`. */
  consider(runs) {
    if (runs) this.#views.start();
    else this.#views.stop();
  }
  stop() {
    this.#views.stop();
  }
  dispose() {
    this.#views.dispose();
  }
  /** The GPU has nothing of it: it is asked for in each frame. */
  restore() {}
  /** Frees what the GPU holds. */
  release() {
    const model = this.model;
    if (model) runtime.getRenderer().then((renderer) => renderer.releaseView(model), () => {});
  }

  /**
   * A frame in an element's context: follows the camera unless it is frozen, and draws. Gives true if a picture was drawn; then frames go on until nothing changes.
   * `wants` has screenError (pixels), maxTriangles, maxMemory (megabytes), morph, frozen.
   */
  frame(renderer, options, wants, seconds, { context }) {
    const model = this.model;
    if (!model || model.isEmpty) return false;
    const started = performance.now();
    this.#frozen = wants.frozen;
    try {
      if (!wants.frozen) this.#follow(model, options, wants, started);
      else if (!this.#stats) this.#say(true);
      if (this.#waits(wants, started)) {
        this.#tell.wake();
        return false;
      }
      if (!runtime.drawViewTo(renderer, model, options, context)) return false;
    } catch (error) {
      this.stop();
      throw error;
    }
    this.#drawn = true;
    this.#frameMs = performance.now() - started;
    // What is missing wakes us when it comes.
    if (!this.#rests && !wants.frozen) this.#tell.wake();
    return true;
  }
  /** The first picture is not due yet. */
  #waits({ frozen }, now) {
    this.#since ??= now;
    return !this.#drawn && !frozen && !this.#settled && now - this.#since < FIRST_PICTURE_MS;
  }
  #follow(model, options, { screenError, maxTriangles, maxMemory, morph }, started) {
    const morphPixels = morph && this.#drawn ? MORPH_PIXELS : Infinity;
    const { splits, collapses, rests } = model.follow({
      ...options, screenError, maxTriangles, morphPixels,
      maxMemory: maxMemory === null ? undefined : maxMemory * BYTES_A_MEGABYTE,
      deadline: started + Math.min(FOLLOW_MS.most, Math.max(FOLLOW_MS.least, this.#frameMs * FOLLOW_PART)),
    });
    this.#views.pump();
    this.#rests = rests;
    this.#settled = rests && !model.isWaiting;
    this.#count(started, splits);
    this.#say(splits + collapses > 0);
  }

  #count(time, splits) {
    this.#rate.push([time, splits]);
    while (this.#rate[0][0] < time - RATE_MS) this.#rate.shift();
  }
  #say(changed) {
    const splitsPerSecond = this.#rate.reduce((sum, [, n]) => sum + n, 0) / (RATE_MS / 1000);
    const { connected, connections } = this.#views;
    const stats = { ...this.model.stats, settled: this.#settled, splitsPerSecond, connected, connections };
    const told = ["settled", "connected", "bytesDown", "bytesUp"];
    const isTold = !changed && this.#stats && told.every((key) => stats[key] === this.#stats[key]);
    this.#stats = stats;
    if (isTold) return;
    this.#tell.refined(this.#stats);
    if (!this.#loaded && this.model.hasAll) {
      this.#loaded = true;
      this.#tell.loaded();
    }
  }

  /** Lines for the debug overlay. */
  overlay() {
    const s = this.model ? { ...this.#stats, ...this.model.stats } : this.#stats;
    if (!s) return [];
    const n = (x) => Math.round(x).toLocaleString("en");
    return [
      `down      ${n(s.bytesDown)} bytes`,
      s.requests ? `requests  ${n(s.requests)}` : `up        ${n(s.bytesUp)} bytes`,
      `front     ${n(s.front)} vertices, ${n(s.triangles)} triangles`,
      `known     ${n(s.known)} of ${n(s.total)} nodes, ${(s.memoryBytes / BYTES_A_MEGABYTE).toFixed(1)} MB`,
      `splits    ${n(s.splitsPerSecond ?? 0)} a second`,
      ...(s.coarser > 1 ? [`error     ${s.coarser.toFixed(1)} times what was asked for`] : []),
      ...(s.evictions ? [`forgot    ${n(s.evictions)} times`] : []),
      `frame     ${this.#frameMs.toFixed(1)} ms`,
      ...(this.#frozen ? ["frozen"] : []),
      ...(this.#views.connected ? [] : ["not connected"]),
    ];
  }
}
