// Starts the server and a browser, and gives pages that have the element defined.
import { spawn } from "node:child_process";
import { createRequire } from "node:module";
import { fileURLToPath, pathToFileURL } from "node:url";

const require = createRequire(`${process.env.PMESH_NODE_MODULES}/package.json`);
const { default: puppeteer } = await import(pathToFileURL(require.resolve("puppeteer-core")).href);

export const browserName = process.env.PMESH_BROWSER ?? "chrome";

const CHROME_FLAGS = [
  "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
  "--no-first-run", "--disable-quic", "--disable-background-networking", "--disable-component-update", "--disable-sync",
];

/** A server on a free port, of the modules and samples that were built before. */
export async function startServer() {
  const { child, base } = await listening(process.env.PMESH_XTASK, ["serve", "--port", "0"]);
  return { base, stop: () => child.kill() };
}

/** `pmesh serve` with views of the samples, for pages of `origin`. */
export async function startViewServer(origin, args = []) {
  const samples = fileURLToPath(new URL("../../www/samples", import.meta.url));
  const port = args.includes("--port") ? [] : ["--port", "0"];
  const { child, base } = await listening(process.env.PMESH_CLI, ["serve", samples, "--origin", origin, ...port, ...args]);
  const stop = (signal) =>
    new Promise((resolve) => {
      child.on("exit", resolve);
      child.kill(signal);
    });
  return { base: base.replace("http:", "ws:"), port: new URL(base).port, stop: () => stop("SIGTERM"), kill: () => stop("SIGKILL") };
}

/** Starts a server that prints its address. */
async function listening(program, args) {
  const child = spawn(program, args, { stdio: ["ignore", "pipe", "inherit"] });
  const base = await new Promise((resolve, reject) => {
    let text = "";
    child.stdout.on("data", (chunk) => {
      text += chunk;
      const found = text.match(/http:\/\/[^/\s]+/);
      if (found) resolve(found[0]);
    });
    child.on("error", reject);
    child.on("exit", (code) => reject(new Error(`${program} ended with ${code}`)));
  });
  return { child, base };
}

/** `still`: pages are told that motion is not wanted. */
export async function startBrowser({ still = false } = {}) {
  return browserName === "firefox"
    ? puppeteer.launch({
        browser: "firefox", executablePath: "/usr/bin/firefox-esr", headless: false, args: ["--width=1000", "--height=800"],
        extraPrefsFirefox: still ? { "ui.prefersReducedMotion": 1 } : {},
      })
    : puppeteer.launch({
        executablePath: "/usr/bin/chromium", headless: true, args: [...CHROME_FLAGS, ...(still ? ["--force-prefers-reduced-motion"] : [])],
      });
}

/** An empty page with the element defined and, on window, helpers that wait for events. */
export async function openPage(browser, base, size = { width: 800, height: 600 }) {
  const page = await browser.newPage();
  await page.setViewport(size);
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(error.message));
  await page.goto(`${base}/empty`);
  await page.evaluate(async () => {
    document.body.style.margin = "0";
    const element = await import("/pmesh-element.js");
    const runtime = await import("/pmesh-runtime.js");
    Object.assign(window, { PMeshElement: element.PMeshElement, runtime });
    /** Adds an element with these attributes and records its events. */
    window.add = (attributes = {}, style = "width:300px;height:300px") => {
      const mesh = document.createElement("p-mesh");
      mesh.log = [];
      for (const type of ["levelready", "levelchange", "progress", "refine", "load", "error"]) {
        mesh.addEventListener(type, (event) => mesh.log.push({ type, detail: event.detail, bytes: mesh.bytes }));
      }
      for (const [name, value] of Object.entries(attributes)) mesh.setAttribute(name, value);
      mesh.style.cssText = style;
      document.body.append(mesh);
      return mesh;
    };
    /** Resolves when an event of that type comes (or has come) for which `ok` holds. */
    window.until = (mesh, type, ok = () => true) =>
      new Promise((resolve) => {
        const found = mesh.log.find((entry) => entry.type === type && ok(entry.detail));
        if (found) return resolve(found);
        const listener = (event) => {
          if (!ok(event.detail)) return;
          mesh.removeEventListener(type, listener);
          resolve({ type, detail: event.detail, bytes: mesh.bytes });
        };
        mesh.addEventListener(type, listener);
      });
    /** Resolves after the element has drawn with nothing left to upload or to morph. */
    window.settled = async (mesh) => {
      await mesh.toBlob();
      let last = null;
      for (let same = 0; same < 4; ) {
        await new Promise((resolve) => requestAnimationFrame(resolve));
        const renderer = await runtime.getRenderer();
        const now = `${mesh.shownLevel} ${renderer.uploadedBytes}`;
        same = now === last ? same + 1 : 0;
        last = now;
      }
    };
    /** The element's picture as RGBA bytes. */
    window.pixels = async (mesh) => {
      const bitmap = await createImageBitmap(await mesh.toBlob());
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height);
    };
    /** Pixels that are not fully transparent. */
    window.covered = async (mesh) => {
      const { data } = await pixels(mesh);
      let count = 0;
      for (let i = 3; i < data.length; i += 4) count += data[i] > 0;
      return count;
    };
  });
  return page;
}
