// Writes docs/gallery-BROWSER.png: the gallery with every model complete.
import { fileURLToPath } from "node:url";
import { browserName, startBrowser, startServer } from "./harness.mjs";

const server = await startServer();
const browser = await startBrowser();
try {
  const page = await browser.newPage();
  await page.setViewport({ width: 1240, height: 1160 });
  await page.goto(`${server.base}/`);
  await page.evaluate(async () => {
    const rate = document.getElementById("rate");
    rate.value = "";
    rate.dispatchEvent(new Event("change"));
    const all = [...document.querySelectorAll("p-mesh")];
    const finest = (mesh) =>
      new Promise((resolve) => {
        if (mesh.shownLevel === 0) resolve();
        mesh.addEventListener("levelchange", ({ detail }) => detail.level === 0 && resolve());
      });
    await Promise.all(all.map(finest));
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
  });
  await page.screenshot({ path: fileURLToPath(new URL(`../../docs/gallery-${browserName}.png`, import.meta.url)) });
} finally {
  await browser.close();
  server.stop();
}
