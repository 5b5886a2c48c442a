// SS97's Figures 5 and 6: a model at equal bytes as a smooth stream and as five levels, and what changes from stage to stage.

const SMOOTH = "samples/knot.slod";
const FIVE = "samples/knot-five.pmesh";
/** Stages: parts of the bytes that five levels take. */
const STAGES = [0.02, 0.05, 0.12, 0.25, 0.5, 1];
const SIDE = 150;
/** How much brighter differences are drawn than they are. */
const GAIN = 4;

const section = document.getElementById("smooth");
const button = section.querySelector("button");
const status = section.querySelector("output");

button.addEventListener("click", async () => {
  button.disabled = true;
  try {
    await draw();
    status.textContent = "";
  } catch (error) {
    status.textContent = error.message;
  }
  button.disabled = false;
});

async function draw() {
  status.textContent = "loading…";
  const smooth = await loaded(SMOOTH);
  const five = await loaded(FIVE);
  // As the paper counts: a vertex is sent once, 12 bytes; a level's triangles are sent anew, 6 bytes each.
  let sent = 0;
  const levels = five.mesh.info.levels.map(({ level, vertices, triangles }, i, all) => {
    sent += 12 * (vertices - (all[i - 1]?.vertices ?? 0)) + 6 * triangles;
    return { level, bytes: sent, triangles };
  });
  const rows = ["stages", "smooth", "difference", "five-levels", "five-difference"].map((name) => section.querySelector(`.${name}`));
  rows.forEach((row) => row.querySelectorAll("td").forEach((cell) => cell.remove()));
  const before = {};
  for (const part of STAGES) {
    const bytes = Math.round(part * sent);
    status.textContent = `drawing what ${bytes.toLocaleString("en")} bytes give…`;
    cell(rows[0]).textContent = `${bytes.toLocaleString("en")} bytes`;
    for (const [name, steps, picture, difference] of [["smooth", smooth, rows[1], rows[2]], ["five", { mesh: five.mesh, levels }, rows[3], rows[4]]]) {
      const step = steps.levels.findLast((l) => l.bytes <= bytes);
      const image = await frame(steps.mesh, step);
      show(cell(picture), image, step ? `${step.triangles.toLocaleString("en")} triangles` : "nothing yet");
      const changed = changes(before[name], image);
      show(cell(difference), changed.image, `${changed.part.toFixed(1)} % of the pixels`);
      before[name] = image;
    }
  }
  smooth.mesh.remove();
  five.mesh.remove();
}

/** An element that has loaded `url`, and where each of its levels ends. */
async function loaded(url) {
  const mesh = document.createElement("p-mesh");
  mesh.style.cssText = `position:fixed;left:0;bottom:0;width:${SIDE}px;height:${SIDE}px;opacity:0.01;pointer-events:none`;
  mesh.loading = "eager";
  const levels = [];
  mesh.addEventListener("levelready", ({ detail }) => levels.push({ step: detail.step, bytes: detail.bytes, triangles: detail.triangles }));
  const done = new Promise((resolve, reject) => {
    mesh.addEventListener("load", resolve, { once: true });
    mesh.addEventListener("error", ({ detail }) => reject(new Error(detail.message)), { once: true });
  });
  mesh.setAttribute("src", url);
  document.body.append(mesh);
  await done;
  // Steps are counted from the coarsest, levels from the finest.
  return { mesh, levels: levels.map((l) => ({ ...l, level: mesh.levelCount - 1 - l.step })) };
}

/** The picture of a level as pixels; white before the first. */
async function frame(mesh, step) {
  const context = new OffscreenCanvas(SIDE, SIDE).getContext("2d", { willReadFrequently: true });
  context.fillStyle = "white";
  context.fillRect(0, 0, SIDE, SIDE);
  if (step && step.triangles > 0) {
    mesh.level = step.level;
    context.drawImage(await createImageBitmap(await mesh.toBlob()), 0, 0, SIDE, SIDE);
  }
  return context.getImageData(0, 0, SIDE, SIDE);
}

/** The difference of two pictures, dark where nothing changes, and the part of the pixels that change visibly. */
function changes(before, image) {
  const out = new ImageData(SIDE, SIDE);
  let count = 0;
  for (let i = 0; i < image.data.length; i += 4) {
    let most = 0;
    for (let k = 0; k < 3; k++) {
      const difference = Math.abs(image.data[i + k] - (before?.data[i + k] ?? 255));
      out.data[i + k] = Math.min(255, GAIN * difference);
      most = Math.max(most, difference);
    }
    out.data[i + 3] = 255;
    count += most > 8;
  }
  return { image: out, part: (100 * count) / (SIDE * SIDE) };
}

function cell(row) {
  return row.appendChild(document.createElement("td"));
}

function show(cell, image, text) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = SIDE;
  canvas.getContext("2d").putImageData(image, 0, 0);
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", text);
  cell.append(canvas, document.createElement("br"), text);
}
