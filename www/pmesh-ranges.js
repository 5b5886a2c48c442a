// Models that are refined where they are looked at, from a file: fetches the ranges that one ViewModel asks for, several at a time. Any server that answers
// range requests will do; of one that does not, the whole file is taken. Knows nothing of drawing.

import { loadModule } from "./pmesh-runtime.js";

/** Milliseconds before each new try after a request failed; the last for all that follow. */
const RETRY_MS = [300, 1000, 3000, 10000];

export class PMeshRanges {
  /** The ViewModel, once the module is there. */
  model = null;
  #src;
  #to;
  #abort = null;
  #tries = 0;
  #timer = 0;
  #ended = false;
  #wanted = false;
  #requests = 0;
  /** The whole file, of a server without ranges. */
  #file = null;

  /** `to` has arrived(), called when there may be more to see, and failed(error). */
  constructor(src, to) {
    this.#src = new URL(src, document.baseURI);
    this.#to = to;
  }

  get connections() {
    return this.#requests;
  }
  get connected() {
    return this.#wanted && !this.#ended && this.#timer === 0;
  }

  start() {
    if (this.#wanted || this.#ended) return;
    this.#wanted = true;
    this.#abort = new AbortController();
    loadModule().then(
      ({ ViewModel }) => {
        if (this.#ended) return;
        this.model ??= ViewModel.ofFile();
        this.pump();
      },
      (error) => this.#fail(error),
    );
  }

  /** Requests what is missing. */
  pump() {
    if (!this.#wanted || this.#ended || this.#timer || !this.model) return;
    for (let range = this.model.pollRange(); range; range = this.model.pollRange()) {
      const [start, end] = range;
      this.#fetch(start, end, this.#abort.signal).then(
        (bytes) => this.#take(start, bytes),
        (error) => this.#missed(start, error),
      );
    }
  }

  async #fetch(start, end, signal) {
    if (this.#file) return this.#file.subarray(start, end);
    this.#requests += 1;
    // A single range needs no preflight.
    const response = await fetch(this.#src, { signal, headers: { Range: `bytes=${start}-${end - 1}` } });
    if (response.status === 206) return new Uint8Array(await response.arrayBuffer());
    // Past the end: nothing is there.
    if (response.status === 416) return new Uint8Array();
    if (!response.ok) {
      const message = `${this.#src}: the server answers ${response.status} ${response.statusText}`;
      throw Object.assign(new Error(message), { code: "http", final: response.status < 500 });
    }
    console.warn(`<p-mesh>: ${this.#src}: the server does not answer range requests, so the whole file is fetched`);
    this.#file = new Uint8Array(await response.arrayBuffer());
    return this.#file.subarray(start, end);
  }

  #take(start, bytes) {
    if (this.#ended || !this.model) return;
    this.#tries = 0;
    try {
      this.model.receive(bytes, start);
    } catch (error) {
      this.#fail(error);
      return;
    }
    this.#to.arrived();
    this.pump();
  }

  #missed(start, error) {
    if (this.#ended || !this.model) return;
    this.model.rangeFailed(start);
    if (error.final) {
      this.#fail(error);
      return;
    }
    if (!this.#wanted || this.#timer) return;
    if (this.model.isEmpty && this.#tries >= RETRY_MS.length - 1) {
      const message = `${this.#src}: the request failed (${error.message}): the server is away, or does not allow this page (CORS)`;
      this.#fail(Object.assign(new Error(message), { code: error.code ?? "network" }));
      return;
    }
    this.#timer = setTimeout(() => {
      this.#timer = 0;
      this.pump();
    }, RETRY_MS[Math.min(this.#tries++, RETRY_MS.length - 1)]);
    this.#to.arrived();
  }

  /** Lets requests go; what is here stays. */
  stop() {
    this.#wanted = false;
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.#abort?.abort();
  }

  dispose() {
    this.stop();
    this.#ended = true;
    this.model = null;
  }

  #fail(error) {
    this.stop();
    this.#ended = true;
    this.#to.failed(error);
  }
}
