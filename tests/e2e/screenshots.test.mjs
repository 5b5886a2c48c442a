// Pictures against references, in Chromium with its software renderer. Tolerance: at most 1 % of the pixels differ by more
// than 24 of 255 in a channel. PMESH_UPDATE=1 renews the references; look at them before committing.
import assert from "node:assert/strict";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { openPage, startBrowser, startServer } from "./harness.mjs";

const SCENES = {
  "globe": { src: "/samples/globe.pmesh" },
  // As FC01's Figure 2: what has come after 10, 15 and 30 kB of a textured model.
  "globe-10kB": { src: "/samples/globe.pmesh", bytes: 10000 },
  "globe-15kB": { src: "/samples/globe.pmesh", bytes: 15000 },
  "globe-30kB": { src: "/samples/globe.pmesh", bytes: 30000 },
  "globe-coarse": { src: "/samples/globe.pmesh", level: "9.5" },
  "marble": { src: "/samples/marble.pmesh", background: "#203040" },
  "part-wireframe": { src: "/samples/part.pmesh", wireframe: "" },
  "knot-representatives": { src: "/samples/knot.pmesh", debug: "representatives", level: "4" },
  "tetrahedra-morph": { src: "/samples/tetrahedra.pmesh", level: "0.5" },
  // What a near view has refined, and its edge.
  "globe-views": { src: "/samples/globe-views.pmesh", "view-dependent": "", wireframe: "", zoom: 3, away: 1.2 },
  "figure6": { src: "/samples/figure6.lod", level: "1" },
};
const DIFFERENT = 24;
const TOLERATED = 0.01;

let server;
let browser;
before(async () => {
  server = await startServer();
  browser = await startBrowser({ still: true });
});
after(async () => {
  await browser?.close();
  server?.stop();
});

for (const [name, attributes] of Object.entries(SCENES)) {
  test(`the picture of ${name} is as it was`, { timeout: 60_000 }, async () => {
    const page = await openPage(browser, server.base);
    const reference = new URL(`reference/${name}.png`, import.meta.url);
    const update = process.env.PMESH_UPDATE === "1";
    assert.ok(update || existsSync(reference), `${name}.png is missing: run with PMESH_UPDATE=1`);
    const expected = update ? null : readFileSync(reference).toString("base64");
    const { png, part } = await page.evaluate(async (attributes, expected, DIFFERENT) => {
      const { bytes, zoom, away, ...rest } = attributes;
      const mesh = add(rest, "width:320px;height:320px");
      if (zoom) {
        mesh.camera.zoom = zoom;
        await until(mesh, "refine", (d) => d.settled && d.splits > 0);
        // Seen from elsewhere.
        mesh.frozen = true;
        mesh.camera.zoom = away;
        mesh.requestRender();
        await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
      }
      let level = Number(attributes.level ?? 0);
      if (bytes) {
        await until(mesh, "levelready");
        level = mesh.info.levels.findLast(({ endByte }) => endByte <= bytes).level;
        mesh.level = level;
      }
      if (!zoom) await until(mesh, "levelchange", (d) => d.level === level);
      await settled(mesh);
      if (attributes.debug) mesh.shadowRoot.querySelector(".debug").hidden = true;
      const blob = await mesh.toBlob();
      const png = await new Promise((resolve) => {
        const reader = new FileReader();
        reader.onload = () => resolve(reader.result.split(",")[1]);
        reader.readAsDataURL(blob);
      });
      if (!expected) return { png, part: 0 };
      const image = new Image();
      image.src = `data:image/png;base64,${expected}`;
      await image.decode();
      const context = new OffscreenCanvas(image.width, image.height).getContext("2d");
      context.drawImage(image, 0, 0);
      const a = context.getImageData(0, 0, image.width, image.height).data;
      const b = (await pixels(mesh)).data;
      if (a.length !== b.length) return { png, part: 1 };
      let different = 0;
      for (let i = 0; i < a.length; i += 4) {
        let most = 0;
        for (let k = 0; k < 4; k++) most = Math.max(most, Math.abs(a[i + k] - b[i + k]));
        different += most > DIFFERENT;
      }
      return { png, part: different / (a.length / 4) };
    }, attributes, expected, DIFFERENT);
    if (update) writeFileSync(reference, Buffer.from(png, "base64"));
    assert.ok(part <= TOLERATED, `${(100 * part).toFixed(2)} % of the pixels differ`);
    assert.deepEqual(page.problems, []);
    await page.close();
  });
}
