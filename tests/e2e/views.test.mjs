// Models that are refined where they are looked at, in a real browser against running `pmesh serve` processes. Waits on events, never on time.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { browserName, openPage, startBrowser, startServer, startViewServer } from "./harness.mjs";

let server;
let views;
let browser;
before(async () => {
  server = await startServer();
  views = await startViewServer(server.base);
  // Pictures of a software renderer take a tenth of a second: geomorphs of many frames are for the core's tests, and one here.
  browser = await startBrowser({ still: true });
});
after(async () => {
  await browser?.close();
  server?.stop();
  views?.stop();
});

/** A test with a page of its own; errors that nobody caught fail it. */
function onPage(name, run) {
  test(`${name} [${browserName}]`, { timeout: 120_000 }, async () => {
    const page = await openPage(browser, server.base);
    await page.evaluate(() => {
      /** Resolves once nothing changes any more, after at least one change from now on. */
      window.rests = (mesh, ok = () => true) =>
        new Promise((resolve) => {
          const listener = ({ detail }) => {
            if (!detail.settled || !ok(detail)) return;
            mesh.removeEventListener("refine", listener);
            resolve(detail);
          };
          mesh.addEventListener("refine", listener);
        });
      window.look = (mesh, camera) => {
        const rest = rests(mesh);
        Object.assign(mesh.camera, camera);
        mesh.requestRender();
        return rest;
      };
    });
    await run(page);
    // Firefox tells of connections that fail as of errors.
    assert.deepEqual(page.problems.filter((p) => !p.startsWith("Firefox can’t establish a connection")), []);
    await page.close();
  });
}

onPage("a view refines, its server is killed in the middle, and another one goes on: nothing is lost, nothing is sent twice", async (page) => {
  const whole = await page.evaluate(async (base) => {
    const mesh = add({ src: `${base}/marble`, background: "#fff" });
    const stats = await rests(mesh, (d) => d.splits > 0);
    window.expected = await pixels(mesh);
    window.uncut = mesh;
    return stats;
  }, views.base);
  assert.ok(whole.splits > 500 && whole.known < whole.total / 2, JSON.stringify(whole));
  let slow = await startViewServer(server.base, ["--rate", "4000"]);
  await page.evaluate(async (base, splits) => {
    window.mesh = add({ src: `${base}/marble`, background: "#fff" });
    await until(mesh, "refine", (d) => d.splits > splits / 3);
  }, slow.base, whole.splits);
  await slow.kill();
  const broken = await page.evaluate(async () => {
    await until(mesh, "refine", (d) => !d.connected);
    return { ...mesh.viewStats, covered: await covered(mesh) };
  });
  assert.ok(broken.splits < whole.splits && broken.covered > 10_000, "what is here stays, while nobody answers");
  slow = await startViewServer(server.base, ["--port", slow.port]);
  const result = await page.evaluate(async () => {
    const stats = await new Promise((resolve) => {
      const look = () => (mesh.viewStats.settled && mesh.viewStats.connections === 2 ? resolve(mesh.viewStats) : requestAnimationFrame(look));
      look();
    });
    const now = await pixels(mesh);
    const different = now.data.reduce((n, x, i) => n + (Math.abs(x - expected.data[i]) > 24), 0);
    return { stats, different, size: now.data.length, errors: mesh.log.filter((e) => e.type === "error") };
  });
  slow.stop();
  assert.deepEqual(result.errors, []);
  assert.equal(result.stats.splits, whole.splits, "each split once");
  assert.equal(result.stats.triangles, whole.triangles);
  assert.ok(result.different < result.size / 100, `${result.different} of ${result.size} values differ`);
  assert.ok(result.stats.bytesUp < whole.bytesUp + whole.known, JSON.stringify(result.stats));
});

onPage("what was seen costs nothing when it is seen again; frozen it stays as it is", async (page) => {
  const result = await page.evaluate(async (base) => {
    const mesh = add({ src: `${base}/marble`, "camera-controls": "", "screen-error": "2" });
    await rests(mesh, (d) => d.splits > 0);
    const lap = async () => {
      const stats = [];
      for (const camera of [{ zoom: 4, yaw: 1 }, { zoom: 1, yaw: 3 }, { zoom: 6, yaw: 5 }, { zoom: 1, yaw: 0.5 }]) stats.push(await look(mesh, camera));
      return stats;
    };
    const first = await lap();
    const second = await lap();
    const canvas = mesh.shadowRoot.querySelector("canvas");
    const press = () => canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "f", bubbles: true }));
    press();
    const { front } = mesh.viewStats;
    Object.assign(mesh.camera, { zoom: 6, yaw: 5 });
    mesh.requestRender();
    await mesh.toBlob();
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    const frozen = { is: mesh.frozen, front: mesh.model === null && mesh.viewStats.front };
    const thawed = rests(mesh);
    press();
    return { first, second, front, frozen, thawed: await thawed, bytes: mesh.bytes };
  }, views.base);
  const [near, , nearer, far] = result.first;
  assert.ok(nearer.splits > near.splits, JSON.stringify(result.first));
  for (const key of ["bytesUp", "bytesDown", "splits"]) assert.equal(result.second[3][key], far[key], `${key} of a second lap`);
  assert.deepEqual(result.second.map((s) => s.triangles > 0), [true, true, true, true]);
  assert.deepEqual(result.frozen, { is: true, front: result.front });
  assert.notEqual(result.thawed.front, result.front);
  assert.equal(result.bytes, result.thawed.bytesDown);
});

onPage("a plain file server does: what is seen is fetched by ranges, a break costs nothing that is here", async (page) => {
  const result = await page.evaluate(async () => {
    const size = Number((await fetch("/samples/globe-views.pmesh", { method: "HEAD" })).headers.get("content-length"));
    const mesh = add({ src: "/samples/globe-views.pmesh", "view-dependent": "", "screen-error": "2", background: "#fff" });
    const first = await rests(mesh, (d) => d.splits > 0);
    const coveredFirst = await covered(mesh);
    mesh.pause();
    const near = look(mesh, { zoom: 5, yaw: 2 });
    mesh.play();
    const second = await near;
    const back = await look(mesh, { zoom: 1, yaw: 0.5 });
    const again = await look(mesh, { zoom: 5, yaw: 2 });
    const plain = add({ src: "/samples/globe-views.pmesh" });
    const error = await until(plain, "error");
    return { size, first, coveredFirst, second, back, again, error: error.detail, errors: mesh.log.filter((e) => e.type === "error") };
  });
  assert.deepEqual(result.errors, []);
  assert.ok(result.coveredFirst > 10_000);
  assert.ok(result.first.front > 200, `${result.first.front} vertices show a globe's relief`);
  assert.ok(result.first.bytesDown < result.size / 3, `${result.first.bytesDown} of ${result.size}`);
  assert.ok(result.second.splits > result.first.splits && result.second.requests > result.first.requests);
  assert.equal(result.again.bytesDown, result.back.bytesDown, "what was seen is here");
  assert.match(result.error.message, /view-dependent/);
});

onPage("geomorphs end, and what stands still then is what is shown at once without them", async (page) => {
  // Firefox has no such emulation.
  if (browserName === "firefox") return;
  const result = await page.evaluate(async (base) => {
    const mesh = add({ src: `${base}/marble`, "screen-error": "1" }, "width:100px;height:100px");
    const at_once = await rests(mesh, (d) => d.splits > 0);
    mesh.remove();
    return at_once;
  }, views.base);
  await page.emulateMediaFeatures([{ name: "prefers-reduced-motion", value: "no-preference" }]);
  const moved = await page.evaluate(async (base) => {
    const mesh = add({ src: `${base}/marble`, "screen-error": "4" }, "width:100px;height:100px");
    let moving = 0;
    mesh.addEventListener("refine", ({ detail }) => (moving = Math.max(moving, detail.moving)));
    await rests(mesh, (d) => d.splits > 0);
    const finer = rests(mesh, (d) => d.splits > 0);
    mesh.setAttribute("screen-error", "1");
    return { ...(await finer), mostMoving: moving };
  }, views.base);
  assert.ok(moved.mostMoving > 10 && moved.moving === 0, JSON.stringify(moved));
  assert.equal(moved.triangles, result.triangles);
});

onPage("limits on triangles and memory are kept, and the front comes to rest under them", async (page) => {
  const result = await page.evaluate(async (base) => {
    const mesh = add({ src: `${base}/marble`, "max-triangles": "3000", "max-memory": "0.6" });
    const out = [await rests(mesh, (d) => d.splits > 0)];
    let most = 0;
    mesh.addEventListener("refine", ({ detail }) => (most = Math.max(most, detail.memoryBytes)));
    for (let i = 1; i < 9; i++) out.push(await look(mesh, { zoom: i % 2 ? 5 : 2, yaw: 0.8 * i }));
    return { out, most, covered: await covered(mesh), errors: mesh.log.filter((e) => e.type === "error") };
  }, views.base);
  assert.deepEqual(result.errors, []);
  assert.ok(result.out.every((s) => s.triangles < 3050), JSON.stringify(result.out.map((s) => s.triangles)));
  assert.ok(result.out.at(-1).evictions > 0 && result.out[0].coarser > 1, JSON.stringify(result.out.at(-1)));
  // By a packet more, which is let go at once.
  assert.ok(result.most < 0.6e6 * 1.5, `${result.most} bytes`);
  assert.ok(result.covered > 10_000);
});

onPage("a model that is not there and a server that is away are told", async (page) => {
  const errors = await page.evaluate(async (base) => {
    const missing = add({ src: `${base}/nothing` });
    const away = add({ src: "ws://127.0.0.1:9/statue" });
    const found = await Promise.all([missing, away].map((mesh) => until(mesh, "error")));
    return found.map((e) => e.detail);
  }, views.base);
  assert.match(errors[0].message, /nothing/);
  assert.equal(errors[1].code, "network");
  assert.match(errors[1].message, /127\.0\.0\.1:9/);
});
