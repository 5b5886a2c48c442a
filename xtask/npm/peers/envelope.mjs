// The files that could have been sent instead of the first bytes of ours: meshoptimizer's simplifier, then Draco.
//
// node envelope.mjs FOLDER PACKAGES: for each FOLDER/NAME.raw writes simplified and decoded meshes, FOLDER/NAME.lod/I.raw, and
// prints a line each: name, I, bytes.
import fs from 'node:fs';
import path from 'node:path';
import { loadDraco, packagesIn, read, say, write } from './shared.mjs';

const [folder, packages] = process.argv.slice(2);
const require = packagesIn(packages);
const draco = await loadDraco(require);
const { MeshoptSimplifier } = require('meshoptimizer');
await MeshoptSimplifier.ready;

// Each a factor of √2 from the next, as far as some hundred triangles are left.
const PARTS = Array.from({ length: 15 }, (_, i) => 2 ** (-i / 2));
const LEAST_TRIANGLES = 100;
const BITS = [8, 9, 10, 11, 12];

/** At most so many triangles, vertices moved to where they fit best. */
function simplified(mesh, triangles) {
  if (triangles >= mesh.triangles) return mesh;
  const [indices, positions] = [mesh.indices.slice(), mesh.positions.slice()];
  const none = new Float32Array(mesh.vertices);
  const [count] = MeshoptSimplifier.simplifyWithUpdate(indices, positions, 3, none, 1, [0], null, triangles * 3, 1e9);
  const left = indices.subarray(0, count);
  // Vertices that are used, in the order of their use.
  const number = new Int32Array(mesh.vertices).fill(-1);
  const kept = [];
  const renumbered = left.map((v) => {
    if (number[v] < 0) {
      number[v] = kept.length / 3;
      kept.push(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]);
    }
    return number[v];
  });
  return { vertices: kept.length / 3, triangles: count / 3, positions: new Float32Array(kept), indices: renumbered };
}

for (const file of fs.readdirSync(folder).filter((f) => f.endsWith('.raw')).sort()) {
  const name = file.slice(0, -4);
  const mesh = read(path.join(folder, file));
  const out = path.join(folder, `${name}.lod`);
  fs.mkdirSync(out, { recursive: true });
  let i = 0;
  for (const part of PARTS) {
    const target = Math.floor(mesh.triangles * part);
    if (target < LEAST_TRIANGLES) break;
    const lod = simplified(mesh, target);
    for (const bits of BITS) {
      const bytes = draco.encode(lod, 10, bits);
      write(path.join(out, `${i}.raw`), draco.decode(bytes));
      say(name, i, bytes.length);
      i += 1;
    }
  }
}
