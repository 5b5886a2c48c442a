// Downloads one stream into one Model: starts while the module compiles, stops and resumes where it stopped, tries again
// when the connection breaks. Knows nothing of drawing.

import { loadModule } from "./pmesh-runtime.js";

/** Milliseconds before each new try after the connection broke. */
const RETRY_MS = [300, 1000, 3000];
/** Scenes that may name one another. */
const MAX_HOPS = 4;

export class PMeshLoader {
  /** The Model, once the module is there. */
  model = null;
  #src;
  #to;
  #abort = null;
  #tries = 0;
  #ended = false;
  /** The server has answered once: what breaks later is worth another try. */
  #answered = false;
  #timer = 0;
  /** Files that a scene names, one after the other the stream; which is next, and the bytes before it. */
  #parts = null;
  #part = 0;
  #partStart = 0;
  #hops = 0;

  /** `to` has events(list), called as bytes arrive, done() and failed(error). `src` may be null for a model that the page makes. */
  constructor(src, to) {
    this.#src = src;
    this.#to = to;
  }

  /** True while bytes are on their way, or another try is due. */
  get running() {
    return this.#abort !== null || this.#timer !== 0;
  }

  /** Begins, or goes on where it was stopped. */
  start() {
    if (this.#abort || this.#ended || !this.#src || this.#timer) return;
    const abort = new AbortController();
    this.#abort = abort;
    this.#run(abort).then(
      () => {
        this.#ended = true;
        if (this.#abort === abort) this.#abort = null;
        this.#to.done();
      },
      (error) => {
        if (this.#abort === abort) this.#abort = null;
        if (!abort.signal.aborted) this.#failed(error);
      },
    );
  }

  /** Lets the connection go; what has arrived stays. */
  stop() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.#abort?.abort();
    this.#abort = null;
  }

  dispose() {
    this.stop();
    this.#ended = true;
    // Its memory goes when the last stream or picture lets go of it.
    this.model = null;
  }

  async emptyModel() {
    const { Model } = await loadModule();
    this.model ??= new Model();
    return this.model;
  }

  async #run(abort) {
    const { signal } = abort;
    const tell = (events) => {
      if (signal.aborted) return;
      this.#answered = true;
      this.#tries = 0;
      const elsewhere = events.find((event) => event.type === "elsewhere");
      if (elsewhere) this.#elsewhere(elsewhere.urls);
      this.#to.events(events);
    };
    if (this.#parts) return this.#runParts(signal, tell);
    if (this.model) {
      await this.model.resume(this.#src, signal, tell);
      return;
    }
    // The request is on its way before the module has compiled.
    const response = fetch(this.#src, { signal }).catch((error) => {
      if (signal.aborted) throw error;
      const message = `the request failed (${error.message}): the server is away, or does not allow this page (CORS)`;
      throw Object.assign(new Error(message), { code: "network" });
    });
    response.catch(() => {});
    await this.emptyModel();
    const answer = await response;
    this.#answered = true;
    await this.model.stream(answer, signal, tell);
    if (this.#parts) await this.#runParts(signal, tell);
  }

  /** The scene says where the model is: relative to the scene, as links are. */
  #elsewhere(urls) {
    if (++this.#hops > MAX_HOPS) throw Object.assign(new Error("the scene names a scene that names a scene …"), { code: "syntax" });
    const base = new URL(this.#src, document.baseURI);
    this.#parts = urls.map((url) => new URL(url, base).href);
    this.#part = this.#partStart = 0;
    this.#src = this.#parts[0];
    this.model = null;
  }

  async #runParts(signal, tell) {
    while (this.#part < this.#parts.length) {
      const parts = this.#parts;
      const url = parts[this.#part];
      const model = this.model ?? (await this.emptyModel());
      const have = model.bytes - this.#partStart;
      try {
        const response = await fetch(url, { signal, headers: have > 0 ? { Range: `bytes=${have}-` } : {} }).catch((error) => {
          throw signal.aborted ? error : Object.assign(new Error(`the request failed (${error.message})`), { code: "network" });
        });
        // Stopped after its last byte: nothing of it is left to ask for.
        const rest = have > 0 && response.status === 416 ? new Response(new Uint8Array()) : response;
        await model.streamPart(rest, have, this.#part === parts.length - 1, signal, tell);
      } catch (error) {
        if (!signal.aborted) error.message = `${url}: ${error.message}`;
        throw error;
      }
      // A scene may name another.
      if (this.#parts !== parts) continue;
      this.#part += 1;
      this.#partStart = model.bytes;
    }
  }

  #failed(error) {
    if (error?.code === "network" && this.#answered && this.#tries < RETRY_MS.length) {
      this.#timer = setTimeout(() => {
        this.#timer = 0;
        this.start();
      }, RETRY_MS[this.#tries++]);
      return;
    }
    this.#ended = true;
    this.#to.failed(error);
  }
}
