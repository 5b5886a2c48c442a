// The element in a real browser, against the real server, module and streams. Waits on events, never on time.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browserName, openPage, startBrowser, startServer } from "./harness.mjs";

let server;
let browser;
const pages = [];

before(async () => {
  server = await startServer();
  browser = await startBrowser();
});
after(async () => {
  await browser?.close();
  server?.stop();
});

async function page(size) {
  const opened = await openPage(browser, server.base, size);
  pages.push(opened);
  return opened;
}
/** A test with a page of its own; errors that nobody caught fail it. */
function onPage(name, run) {
  test(`${name} [${browserName}]`, { timeout: 120_000 }, async () => {
    const opened = await page();
    await run(opened);
    assert.deepEqual(opened.problems, []);
    await opened.close();
  });
}

onPage("the main job: a model over 200 kB/s shows within 5 % of its bytes, refines in order, and any level is free", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/globe.pmesh?rate=200k" });
    // Pixels of each picture: nothing goes blank while buffers grow and the image arrives.
    const canvas = mesh.shadowRoot.querySelector("canvas");
    const areas = [];
    mesh.addEventListener("levelchange", () => {
      const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
      areas.push(data.reduce((n, x, i) => n + (i % 4 === 3 && x > 0), 0));
    });
    const first = await until(mesh, "levelchange");
    await until(mesh, "load");
    await settled(mesh);
    const renderer = await runtime.getRenderer();
    const uploadedBefore = renderer.uploadedBytes;
    const shown = [];
    for (const level of [2.5, 0, mesh.levelCount - 1, 7.25, 3, 0.5, 11]) {
      mesh.setLevel(level);
      const { detail } = await until(mesh, "levelchange", (d) => d.level === level);
      shown.push([level, detail.triangles === mesh.model.triangleCount(Math.floor(level))]);
    }
    return {
      first: first.bytes,
      areas,
      total: mesh.info.totalBytes,
      received: mesh.bytes,
      steps: mesh.log.filter((e) => e.type === "levelready").map((e) => e.detail.step),
      count: mesh.levelCount,
      shown,
      uploaded: renderer.uploadedBytes - uploadedBefore,
      errors: mesh.log.filter((e) => e.type === "error"),
    };
  });
  assert.ok(result.first < 0.05 * result.total, `first picture after ${result.first} of ${result.total} bytes`);
  assert.equal(result.received, result.total);
  assert.ok(Math.min(...result.areas) > 0.6 * Math.max(...result.areas), `pixels covered: ${result.areas}`);
  assert.deepEqual(result.steps, [...Array(result.count).keys()]);
  assert.ok(result.shown.every(([, triangles]) => triangles), JSON.stringify(result.shown));
  assert.equal(result.uploaded, 0, "setLevel uploads no geometry");
  assert.deepEqual(result.errors, []);
});

onPage("level 2.5 is drawn between levels 3 and 2, as the arrays say", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/knot.pmesh" });
    await until(mesh, "load");
    await settled(mesh);
    const grab = async (level) => {
      mesh.setLevel(level);
      await until(mesh, "levelchange", (d) => d.level === level);
      return (await pixels(mesh)).data;
    };
    const level = mesh.levelCount - 4;
    const [coarse, half, fine] = [await grab(level + 1), await grab(level + 0.5), await grab(level)];
    const difference = (a, b) => a.reduce((sum, x, i) => sum + Math.abs(x - b[i]), 0);
    const arrays = [level + 1, level + 0.5, level].map((x) => mesh.model.arrays(x).positions);
    // A vertex that is new at `level` stands half way from its representative.
    const moved = arrays[1].some((x, i) => i >= arrays[0].length && x !== arrays[2][i]);
    return { ends: difference(coarse, fine), a: difference(coarse, half), b: difference(half, fine), moved };
  });
  assert.ok(result.moved);
  assert.ok(result.a > 0 && result.b > 0 && result.a < result.ends * 1.2 && result.b < result.ends * 1.2, JSON.stringify(result));
});

onPage("every stream plays: ours in two profiles, text, smooth levels, patches, scenes; levels in order, the same model at the end", async (page) => {
  const result = await page.evaluate(async () => {
    const out = {};
    for (const ending of [".pmesh", "-fast.pmesh", ".lod.gz", ".slod", ".pits", ".pfs", ".x3d", "-levels.wrl"]) {
      const mesh = add({ src: `/samples/knot${ending}?rate=400k` });
      await until(mesh, "load");
      await settled(mesh);
      const steps = mesh.log.filter((e) => e.type === "levelready").map((e) => e.detail.step);
      const shown = { ordered: steps.every((step, i) => step === i), levels: steps.length, count: mesh.levelCount };
      shown.triangles = mesh.model.triangleCount(0);
      shown.area = await covered(mesh);
      const uploaded = (await runtime.getRenderer()).uploadedBytes;
      mesh.setLevel((mesh.levelCount - 1) / 2 + 0.25);
      await until(mesh, "levelchange", (d) => d.level === mesh.level);
      shown.free = (await runtime.getRenderer()).uploadedBytes === uploaded;
      shown.half = await covered(mesh);
      shown.errors = mesh.log.filter((e) => e.type === "error");
      out[ending] = shown;
      mesh.remove();
    }
    return out;
  });
  for (const [ending, shown] of Object.entries(result)) {
    assert.deepEqual(shown.errors, [], ending);
    assert.ok(shown.ordered && shown.levels === shown.count && shown.free, `${ending}: ${JSON.stringify(shown)}`);
    assert.equal(shown.triangles, result[".pmesh"].triangles, ending);
    assert.ok(Math.abs(shown.area - result[".pmesh"].area) < 0.02 * result[".pmesh"].area, `${ending}: ${JSON.stringify(result)}`);
    assert.ok(shown.half > 0.4 * shown.area, `${ending}: ${JSON.stringify(shown)}`);
  }
  assert.ok(result[".slod"].levels > 10 * result[".pits"].levels);
});

onPage("a scene's levels are fetched only when wanted, and one that is missing is an error that names its URL", async (page) => {
  const requests = [];
  page.on("request", (request) => requests.push(request.url()));
  const stopped = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/knot-levels.wrl", "max-triangles": "8000" });
    await until(mesh, "levelready", (d) => d.triangles > 3000);
    await new Promise((resolve) => setTimeout(resolve, 700));
    const reached = mesh.model.arrivedLevels;
    mesh.setAttribute("max-triangles", "1000000");
    await until(mesh, "load");
    return { reached, all: mesh.model.arrivedLevels, triangles: mesh.model.triangleCount(0) };
  });
  assert.ok(stopped.reached < stopped.all, JSON.stringify(stopped));
  assert.equal(stopped.triangles, 48000);
  const files = requests.filter((url) => url.endsWith(".pits"));
  assert.equal(new Set(files).size, stopped.all, `${files.length} requests`);
  const failed = await page.evaluate(async () => {
    const names = [0, 1, 99].map((i) => `"/samples/knot-levels-${i}.pits"`).join(" ");
    const scene = `#VRML V2.0 utf8\nShape { geometry ProgIndexedTriSet { levelsUrl [ ${names} ] } }`;
    const absolute = scene.replaceAll('"/', `"${location.origin}/`);
    const mesh = add({ src: URL.createObjectURL(new Blob([absolute])) });
    const error = await until(mesh, "error");
    return { error: error.detail, levels: mesh.model.arrivedLevels };
  });
  assert.ok(failed.error.message.includes("knot-levels-99.pits"), failed.error.message);
  assert.deepEqual([failed.error.code, failed.levels], ["http", 2]);
});

onPage("G.9: a canceled levelready waits for update()", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/knot.pmesh" });
    mesh.addEventListener("levelready", (event) => event.detail.step >= 3 && event.preventDefault());
    await until(mesh, "load");
    await until(mesh, "levelchange", () => mesh.levelCount - 1 - mesh.shownLevel === 2);
    await settled(mesh);
    const held = mesh.levelCount - 1 - mesh.shownLevel;
    mesh.update();
    await until(mesh, "levelchange", (d) => d.level === 0);
    return held;
  });
  assert.equal(result, 2);
});

onPage("setLevel during the download holds, and stops it once reached; range requests fetch the rest", async (page) => {
  const requests = [];
  page.on("request", (request) => request.url().includes("marble") && requests.push(request.headers().range ?? "all"));
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/marble.pmesh?rate=100k", level: "6" });
    await until(mesh, "levelchange", (d) => d.level === 6);
    await settled(mesh);
    const stopped = mesh.bytes;
    const whole = mesh.info.totalBytes;
    mesh.level = null;
    await until(mesh, "load");
    await until(mesh, "levelchange", (d) => d.level === 0);
    return { stopped, whole, end: mesh.bytes };
  });
  assert.ok(result.stopped < result.whole / 2, `stopped at ${result.stopped} of ${result.whole}`);
  assert.equal(result.end, result.whole);
  assert.equal(requests.length, 2);
  assert.match(requests[1], /^bytes=\d+-$/);
});

onPage("a connection that breaks is resumed where it broke", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/knot.pmesh?cut=20000&rate=200k" });
    await until(mesh, "load");
    return { bytes: mesh.bytes, total: mesh.info.totalBytes, errors: mesh.log.filter((e) => e.type === "error").length };
  });
  assert.equal(result.bytes, result.total);
  assert.equal(result.errors, 0);
});

onPage("bad sources are error events with a code, and what had arrived stays", async (page) => {
  const result = await page.evaluate(async () => {
    const codes = {};
    for (const src of ["/samples/missing.pmesh", "/index.html", "/pmesh_bg.wasm", "http://127.0.0.1:9/none.pmesh"]) {
      const mesh = add({ src });
      codes[src] = (await until(mesh, "error")).detail.code;
      mesh.remove();
    }
    const bytes = new Uint8Array(await (await fetch("/samples/knot.pmesh")).arrayBuffer());
    bytes[bytes.length - 5000] ^= 1;
    const mesh = add({ src: URL.createObjectURL(new Blob([bytes])) });
    const error = (await until(mesh, "error")).detail;
    await settled(mesh);
    const cut = add({ src: URL.createObjectURL(new Blob([bytes.slice(0, bytes.length / 2)])) });
    const short = (await until(cut, "error")).detail;
    const text = add({ src: URL.createObjectURL(new Blob(["{0,0,0,1,0,0,0,1,0}\n{0,1,2}\n{0,0"])) });
    const truncated = (await until(text, "error")).detail;
    await settled(text);
    return { codes, error, levels: mesh.model.arrivedLevels, shown: await covered(mesh), short, truncated, kept: await covered(text) };
  });
  assert.deepEqual(Object.values(result.codes), ["http", "unknown-format", "unknown-format", "network"]);
  assert.ok(["checksum", "syntax", "invalid-mesh"].includes(result.error.code), result.error.message);
  assert.match(result.error.message, /byte \d+/);
  assert.ok(result.levels > 10 && result.shown > 5000);
  assert.equal(result.short.code, "truncated", result.short.message);
  assert.equal(result.truncated.code, "truncated");
  assert.match(result.truncated.message, /line 3/);
  assert.ok(result.kept > 1000);
});

onPage("a refusal by CORS is an error event that says so", async (page) => {
  const other = await startServer();
  try {
    const message = await page.evaluate(async (src) => (await until(add({ src }), "error")).detail, `${other.base}/samples/knot.pmesh`);
    assert.equal(message.code, "network");
    assert.match(message.message, /CORS/);
    // Firefox also reports the refusal to the page itself.
    page.problems = page.problems.filter((text) => !text.includes("Cross-Origin Request Blocked"));
  } finally {
    other.stop();
  }
});

onPage("changing src aborts the download before; removing and putting back keeps the mesh", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/globe.pmesh?rate=50k" });
    await until(mesh, "levelready");
    mesh.log.length = 0;
    mesh.src = "/samples/tetrahedra.pmesh";
    await until(mesh, "load");
    await until(mesh, "levelchange", (d) => d.level === 0);
    const steps = mesh.log.filter((e) => e.type === "levelready").map((e) => e.detail.step);
    const model = mesh.model;
    mesh.remove();
    await new Promise((resolve) => setTimeout(resolve));
    document.body.append(mesh);
    await settled(mesh);
    return { steps, same: mesh.model === model, covered: await covered(mesh), errors: mesh.log.filter((e) => e.type === "error") };
  });
  assert.deepEqual(result.steps, [0, 1, 2]);
  assert.ok(result.same && result.covered > 1000);
  assert.deepEqual(result.errors, []);
});

onPage("a lost context comes back with the same picture", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ src: "/samples/globe.pmesh" });
    await until(mesh, "load");
    await until(mesh, "levelchange", (d) => d.level === 0);
    await settled(mesh);
    const before = (await pixels(mesh)).data;
    const generation = runtime.rendererGeneration();
    runtime.sharedContext().getExtension("WEBGL_lose_context").loseContext();
    while (runtime.rendererGeneration() === generation) await new Promise((resolve) => requestAnimationFrame(resolve));
    await settled(mesh);
    const after = (await pixels(mesh)).data;
    return { different: after.reduce((n, x, i) => n + (Math.abs(x - before[i]) > 2), 0), size: after.length, errors: mesh.log.filter((e) => e.type === "error") };
  });
  assert.deepEqual(result.errors, []);
  assert.ok(result.different < result.size * 0.001, `${result.different} of ${result.size}`);
});

onPage("24 elements share one context, and the page's triangle budget", async (page) => {
  const result = await page.evaluate(async () => {
    const names = ["knot", "marble", "part", "tetrahedra"];
    const all = Array.from({ length: 24 }, (_, i) => add({ src: `/samples/${names[i % 4]}.pmesh` }, "width:120px;height:120px"));
    await Promise.all(all.map((mesh) => until(mesh, "load")));
    await Promise.all(all.map((mesh) => until(mesh, "levelchange", (d) => d.level === 0)));
    const shown = await Promise.all(all.map(covered));
    const generations = runtime.rendererGeneration();
    PMeshElement.triangleBudget = 24_000;
    const within = (mesh) => until(mesh, "levelchange", (d) => d.triangles <= 1000 || d.level === mesh.levelCount - 1);
    await Promise.all(all.filter((mesh) => mesh.model.triangleCount(0) > 1000).map((mesh) => { mesh.log.length = 0; return within(mesh); }));
    PMeshElement.triangleBudget = null;
    return { shown, generations };
  });
  assert.equal(result.generations, 1);
  assert.ok(result.shown.every((count) => count > 1000), JSON.stringify(result.shown));
});

onPage("max-triangles and auto-level bound what is shown and downloaded", async (page) => {
  const result = await page.evaluate(async () => {
    const few = add({ src: "/samples/marble.pmesh?rate=200k", "max-triangles": "3000" });
    const rough = add({ src: "/samples/knot.pmesh?rate=200k", "auto-level": "2" });
    await until(few, "levelchange", (d) => d.level === few.model.levelForTriangles(3000));
    await until(rough, "levelchange", (d) => d.level > 0);
    await settled(few);
    await settled(rough);
    const row = few.info.levels.find((l) => l.level === few.shownLevel);
    const finer = few.info.levels.find((l) => l.level === few.shownLevel - 1);
    return { triangles: row.triangles, next: finer.triangles, part: few.bytes / few.info.totalBytes, rough: rough.shownLevel, roughPart: rough.bytes / rough.info.totalBytes };
  });
  assert.ok(result.triangles <= 3000 && result.next > 3000);
  assert.ok(result.part < 0.5 && result.roughPart < 0.9, JSON.stringify(result));
  assert.ok(result.rough > 0);
});

onPage("a page can build a model itself: addLevel, setLevel, toBlob", async (page) => {
  const result = await page.evaluate(async () => {
    const mesh = add({ level: "0.5" });
    await mesh.addLevel({ positions: [0, 0, 0, 1, 0, 0, 0, 1, 0], triangles: [0, 1, 2] });
    const ready = await mesh.addLevel({ positions: [1, 1, 0], triangles: [1, 3, 2], representatives: [3, 1] });
    await until(mesh, "levelchange", (d) => d.level === 0.5);
    const morphed = [...mesh.model.arrays(0.5).positions.slice(9)];
    const refused = await mesh.addLevel({ positions: [1, 2, 3], representatives: [4, 4] }).catch((error) => error.code);
    let thrown = null;
    try { mesh.setLevel(Number.NaN); } catch (error) { thrown = error.name; }
    const blob = await mesh.toBlob();
    return { ready, morphed, refused, thrown, type: blob.type, covered: await covered(mesh) };
  });
  assert.equal(result.ready.step, 1);
  assert.deepEqual(result.morphed, [1, 0.5, 0]);
  assert.equal(result.refused, "invalid-mesh");
  assert.equal(result.thrown, "RangeError");
  assert.equal(result.type, "image/png");
  assert.ok(result.covered > 1000);
});

onPage("properties set before the element is defined, keyboard, label and status", async (page) => {
  const result = await page.evaluate(async () => {
    const raw = document.createElement("p-mesh");
    Object.defineProperty(raw, "maxTriangles", { value: 500, configurable: true, writable: true, enumerable: true });
    raw.alt = "A knot";
    raw.setAttribute("camera-controls", "");
    raw.setAttribute("background", "#204060");
    raw.src = "/samples/knot.pmesh";
    raw.log = [];
    document.body.append(raw);
    await new Promise((resolve) => raw.addEventListener("levelchange", resolve, { once: true }));
    const canvas = raw.shadowRoot.querySelector("canvas");
    const before = raw.camera.yaw;
    canvas.focus();
    canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    const { data } = await pixels(raw);
    return {
      attribute: raw.getAttribute("max-triangles"),
      label: canvas.getAttribute("aria-label"),
      turned: raw.camera.yaw > before,
      status: raw.shadowRoot.querySelector("[role=status]").textContent,
      corner: [...data.slice(0, 4)],
    };
  });
  assert.equal(result.attribute, "500");
  assert.equal(result.label, "A knot");
  assert.ok(result.turned);
  assert.match(result.status, /A knot/);
  assert.deepEqual(result.corner, [0x20, 0x40, 0x60, 255]);
});

onPage("the gallery encodes a dropped file in the browser and shows it", async (page) => {
  await page.goto(`${server.base}/`);
  const triangles = await page.evaluate(async () => {
    document.getElementById("rate").value = "";
    const corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]].map((v) => `v ${v.join(" ")}`).join("\n");
    const file = new File([`${corners}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n`], "corner.obj");
    const transfer = new DataTransfer();
    transfer.items.add(file);
    const input = document.getElementById("file");
    input.files = transfer.files;
    const card = new Promise((resolve) => {
      new MutationObserver((records) => records.forEach((r) => r.addedNodes.forEach((n) => n.textContent.includes("corner.obj") && resolve(n)))).observe(
        document.getElementById("gallery"), { childList: true });
    });
    input.dispatchEvent(new Event("change"));
    const mesh = (await card).querySelector("p-mesh");
    return new Promise((resolve) => mesh.addEventListener("levelchange", (event) => resolve(event.detail.triangles)));
  });
  assert.equal(triangles, 4);
});
