// Models that are refined where they are looked at: carries the messages of one ViewModel over a WebSocket, and connects again when it breaks; what is
// here stays. Knows nothing of drawing.

import { loadModule } from "./pmesh-runtime.js";

/** Milliseconds before each new try after the connection broke; the last for all that follow. */
const RETRY_MS = [300, 1000, 3000, 5000];
/** Milliseconds between two views that are sent. */
const VIEW_MS = 80;

export class PMeshViews {
  /** The ViewModel, once the module is there. */
  model = null;
  #src;
  #to;
  #socket = null;
  #tries = 0;
  #timer = 0;
  #viewTimer = 0;
  #lastView = 0;
  #ended = false;
  #wanted = false;
  #connections = 0;

  /** `to` has arrived(), called when there may be more to see, and failed(error). */
  constructor(src, to) {
    this.#src = new URL(src, document.baseURI);
    this.#to = to;
  }

  /** True for addresses that a server of views answers. */
  static speaks(src) {
    return /^wss?:/i.test(src);
  }

  /** Connections made so far. */
  get connections() {
    return this.#connections;
  }
  /** True while the server can be asked. */
  get connected() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Connects, or goes on from what is here. */
  start() {
    this.#wanted = true;
    if (this.#socket || this.#ended || this.#timer) return;
    // A server lets silent sessions go: we come back when something is missing.
    if (this.model && !this.model.isWaiting) return;
    // The connection is made while the module compiles.
    let socket;
    try {
      socket = new WebSocket(this.#src);
    } catch (error) {
      this.#fail("network", `${this.#src} is no address of a server: ${error.message}`);
      return;
    }
    socket.binaryType = "arraybuffer";
    this.#socket = socket;
    this.#talk(socket).catch((error) => this.#socket === socket && this.#fail(error.code ?? "internal", error.message));
  }

  async #talk(socket) {
    const early = [];
    socket.onmessage = ({ data }) => early.push(data);
    const opened = new Promise((resolve) => {
      socket.onopen = () => resolve(true);
      socket.onclose = () => resolve(false);
    });
    const { ViewModel } = await loadModule();
    if (!(await opened)) return this.#closed(socket);
    if (this.#socket !== socket) return;
    this.#connections += 1;
    // A server finds a model by its path.
    if (this.model) this.model.reconnect();
    else this.model = new ViewModel(decodeURIComponent(this.#src.pathname.replace(/^\//, "")));
    socket.onclose = () => this.#closed(socket);
    socket.onmessage = ({ data }) => this.#receive(socket, data);
    early.forEach((data) => this.#receive(socket, data));
    this.pump();
  }

  #receive(socket, data) {
    if (this.#socket !== socket || !this.model) return;
    try {
      this.model.receive(new Uint8Array(data));
    } catch (error) {
      // What the server says may be over with another one; what does not decode will not decode again.
      if (error.code === "server" && !this.model.isEmpty) return;
      this.#fail(error.code ?? "internal", error.message);
      return;
    }
    this.#tries = 0;
    this.#to.arrived();
    this.pump();
  }

  #closed(socket) {
    if (this.#socket !== socket) return;
    this.#socket = null;
    this.#to.arrived();
    if (!this.#wanted || this.#ended || (this.model && !this.model.isWaiting)) return;
    if (!this.model && this.#tries >= RETRY_MS.length - 1) {
      this.#fail("network", `there is no answer from ${this.#src}: the server is away, or does not allow this page (pmesh serve --origin)`);
      return;
    }
    this.#timer = setTimeout(() => {
      this.#timer = 0;
      if (this.#wanted) this.start();
    }, RETRY_MS[Math.min(this.#tries++, RETRY_MS.length - 1)]);
  }

  /** Sends what waits to be sent; views not too often. */
  pump() {
    if (this.#wanted && this.model?.isWaiting) this.start();
    if (!this.connected || !this.model || this.#viewTimer) return;
    const wait = this.#lastView + VIEW_MS - performance.now();
    if (wait > 0) {
      this.#viewTimer = setTimeout(() => {
        this.#viewTimer = 0;
        this.pump();
      }, wait);
      return;
    }
    const message = this.model.poll();
    if (!message) return;
    this.#lastView = performance.now();
    this.#socket.send(message);
  }

  /** Lets the connection go; what is here stays. */
  stop() {
    this.#wanted = false;
    clearTimeout(this.#timer);
    clearTimeout(this.#viewTimer);
    this.#timer = this.#viewTimer = 0;
    const socket = this.#socket;
    this.#socket = null;
    socket?.close();
  }

  dispose() {
    this.stop();
    this.#ended = true;
    this.model = null;
  }

  #fail(code, message) {
    this.stop();
    this.#ended = true;
    this.#to.failed(Object.assign(new Error(message), { code }));
  }
}
