// The same model through every stream at one byte rate: pictures, figures, and triangles against bytes.

const STREAMS = [
  ["samples/knot.pmesh", ".pmesh", "ours, compact: splits by models that learn", "#c2185b"],
  ["samples/knot-fast.pmesh", ".pmesh, fast", "ours: records a vertex, deflated", "#2b6a8f"],
  ["samples/knot.pits", ".pits", "FC01's patches, entropy-coded", "#b5482a"],
  ["samples/knot.pfs", ".pfs", "forest splits, entropy-coded", "#b0872a"],
  ["samples/knot.slod", ".slod", "SS97's packets, a level a vertex", "#3c8a4d"],
  ["samples/knot.lod.gz", ".lod.gz", "GV99's text, gzipped", "#7a5bb0"],
  ["samples/knot.x3d", ".x3d", "FC01's nodes in X3D, looked at whenever the text has doubled", "#777777"],
];

const byId = (id) => document.getElementById(id);
const rows = STREAMS.map(([url, name, what, color]) => {
  const card = document.createElement("article");
  card.innerHTML = `<h2></h2><p class="what"></p><p-mesh camera-controls></p-mesh>`;
  card.querySelector("h2").textContent = name;
  card.querySelector("h2").style.color = color;
  card.querySelector(".what").textContent = what;
  byId("streams").append(card);
  const cells = document.createElement("tr");
  cells.innerHTML = `<td style="color:${color}">${name}</td>${"<td></td>".repeat(4)}`;
  byId("figures").append(cells);
  const mesh = card.querySelector("p-mesh");
  mesh.alt = `Trefoil knot as ${name}`;
  const row = { url, color, mesh, cells: [...cells.cells], points: [] };
  mesh.addEventListener("levelready", ({ detail }) => {
    const { bytes, triangles, level, error } = detail;
    if (triangles > 0) row.points.push([bytes, triangles]);
    row.latest = [triangles.toLocaleString("en"), error === null ? "–" : error.toExponential(2)];
    row.level = level;
    due();
  });
  mesh.addEventListener("progress", due);
  mesh.addEventListener("error", ({ detail }) => {
    row.cells[4].textContent = detail.message;
  });
  return row;
});

let pending = false;
function due() {
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => {
    pending = false;
    rows.forEach(showFigures);
    drawChart();
  });
}

function showFigures({ mesh, cells, latest, level }) {
  cells[1].textContent = mesh.bytes.toLocaleString("en");
  if (!latest) return;
  cells[2].textContent = `${level} of ${mesh.levelCount}`;
  [cells[3].textContent, cells[4].textContent] = latest;
}

const BYTES = [100, 3e6];
const TRIANGLES = [10, 1e5];

function drawChart() {
  const canvas = byId("chart");
  const context = canvas.getContext("2d");
  const style = getComputedStyle(document.body);
  const [left, bottom] = [60, 30];
  const along = (value, [low, high], length) => (length * Math.log(value / low)) / Math.log(high / low);
  const x = (bytes) => left + along(bytes, BYTES, canvas.width - left - 10);
  const y = (triangles) => canvas.height - bottom - along(triangles, TRIANGLES, canvas.height - bottom - 10);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.font = "12px system-ui, sans-serif";
  context.strokeStyle = style.getPropertyValue("--line");
  context.fillStyle = style.getPropertyValue("--soft");
  context.lineWidth = 1;
  for (let power = 2; 10 ** power <= BYTES[1]; power++) {
    line(context, [[x(10 ** power), y(TRIANGLES[0])], [x(10 ** power), y(TRIANGLES[1])]]);
    context.fillText(`${(10 ** power).toLocaleString("en")} bytes`, x(10 ** power) + 3, canvas.height - 10);
  }
  for (let power = 1; 10 ** power <= TRIANGLES[1]; power++) {
    line(context, [[x(BYTES[0]), y(10 ** power)], [x(BYTES[1]), y(10 ** power)]]);
    context.fillText((10 ** power).toLocaleString("en"), 4, y(10 ** power) + 4);
  }
  context.lineWidth = 2;
  for (const { color, points } of rows) {
    context.strokeStyle = color;
    const steps = points.flatMap(([bytes, triangles], i) => (i > 0 ? [[bytes, points[i - 1][1]], [bytes, triangles]] : [[bytes, triangles]]));
    line(context, steps.map(([bytes, triangles]) => [x(Math.max(bytes, BYTES[0])), y(Math.max(triangles, TRIANGLES[0]))]));
  }
}

function line(context, points) {
  context.beginPath();
  points.forEach(([px, py]) => context.lineTo(px, py));
  context.stroke();
}

function restart() {
  const rate = byId("rate").value;
  for (const row of rows) {
    row.points = [];
    row.latest = undefined;
    row.mesh.removeAttribute("src");
    row.mesh.setAttribute("src", rate ? `${row.url}?rate=${rate}` : row.url);
  }
  drawChart();
}

byId("restart").addEventListener("click", restart);
byId("rate").addEventListener("change", restart);
byId("wireframe").addEventListener("change", ({ target }) => rows.forEach(({ mesh }) => (mesh.wireframe = target.checked)));
restart();
