// Decoding in WebAssembly, in Chromium, on one thread: millions of triangles a second, and level selection as arrays. Of the
// URLs named, or of the samples and the server's models.
import { startBrowser, startServer } from "./harness.mjs";

const server = await startServer();
const browser = await startBrowser();
try {
  const page = await browser.newPage();
  await page.goto(`${server.base}/empty`);
  const rows = await page.evaluate(async (asked) => {
    const module = await import("/pmesh.js");
    await module.default();
    const own = await (await fetch("/models/index.json")).json().catch(() => []);
    const streams = ["pits", "pfs", "slod", "lod.gz", "x3d"].map((ending) => `/samples/knot.${ending}`);
    const names = asked.length > 0 ? asked : ["globe", "marble", "knot", "part"].map((n) => `/samples/${n}.pmesh`).concat(streams).concat(own.map((n) => `/models/${n}`));
    const rows = [];
    for (const name of names) {
      const bytes = new Uint8Array(await (await fetch(name)).arrayBuffer());
      const times = [];
      let model;
      for (let run = 0; run < 3; run++) {
        model = new module.Model();
        const start = performance.now();
        model.push(bytes);
        model.finish();
        times.push(performance.now() - start);
      }
      const start = performance.now();
      model.arrays(0);
      const arrays = performance.now() - start;
      const triangles = model.triangleCount(0);
      rows.push({ name, triangles, bytes: bytes.length, ms: Math.min(...times), rate: triangles / Math.min(...times) / 1000, arrays, memory: model.memoryBytes });
    }
    return rows;
  }, process.argv.slice(2));
  for (const r of rows) {
    process.stdout.write(`${r.name.padEnd(34)} ${String(r.triangles).padStart(9)} triangles  decode ${r.ms.toFixed(1).padStart(8)} ms = ${r.rate.toFixed(2)} MT/s  arrays(0) ${r.arrays.toFixed(1)} ms  memory ${r.memory}\n`);
  }
} finally {
  await browser.close();
  server.stop();
}
