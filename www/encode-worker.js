// Encodes a dropped file away from the page's thread.
import init, { encode } from "./encoder/pmesh_encoder.js";

const ready = init();

self.onmessage = async ({ data: { name, bytes, bits } }) => {
  try {
    await ready;
    const progress = (part) => self.postMessage({ progress: part });
    const warn = (warning) => self.postMessage({ warning });
    const stream = encode(name, new Uint8Array(bytes), bits, progress, warn);
    self.postMessage({ stream }, [stream.buffer]);
  } catch (error) {
    self.postMessage({ error: error.message ?? String(error) });
  }
};
