// Other people's coders, and our own decoder in WebAssembly, on the meshes that the native benchmark has prepared.
//
// node peers.mjs FOLDER PACKAGES PKG: reads FOLDER/NAME.raw and FOLDER/NAME.*.pmesh; prints a line each: name, coder, bits,
// bytes, seconds to encode, seconds to decode ("-" where that is measured elsewhere). PACKAGES holds node_modules, PKG our module.
import fs from 'node:fs';
import path from 'node:path';
import zlib from 'node:zlib';
import { pathToFileURL } from 'node:url';
import { loadDraco, packagesIn, read, say, seconds } from './shared.mjs';

const [folder, packages, pkg] = process.argv.slice(2);
const require = packagesIn(packages);
const { encode, decode } = await loadDraco(require);

function draco(name, mesh, level, bits) {
  const [bytes, encodeSecs] = seconds(() => encode(mesh, level, bits));
  const [again, decodeSecs] = seconds(() => decode(bytes));
  say(name, `draco cl${level}`, bits, bytes.length, encodeSecs, decodeSecs, mesh.triangles - again.triangles);
}

const { MeshoptEncoder, MeshoptDecoder } = require('meshoptimizer');
await Promise.all([MeshoptEncoder.ready, MeshoptDecoder.ready]);

function grid(mesh, bits) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  mesh.positions.forEach((x, i) => {
    low[i % 3] = Math.min(low[i % 3], x);
    high[i % 3] = Math.max(high[i % 3], x);
  });
  const step = Math.max(...high.map((h, k) => h - low[k])) / (2 ** bits - 1);
  const out = new Uint16Array(mesh.vertices * 4);
  for (let v = 0; v < mesh.vertices; v++) {
    for (let k = 0; k < 3; k++) out[4 * v + k] = Math.round((mesh.positions[3 * v + k] - low[k]) / step);
  }
  return out;
}

const brotli = (bytes) => zlib.brotliCompressSync(bytes, { params: { [zlib.constants.BROTLI_PARAM_QUALITY]: 9 } });

function meshopt(name, mesh, bits) {
  const points = grid(mesh, bits);
  const [[packed, coded], encodeSecs] = seconds(() => {
    const indices = new Uint32Array(mesh.indices);
    const [remap, unique] = MeshoptEncoder.reorderMesh(indices, true, true);
    const sorted = new Uint16Array(unique * 4);
    for (let v = 0; v < mesh.vertices; v++) if (remap[v] !== 0xffffffff) sorted.set(points.subarray(4 * v, 4 * v + 4), 4 * remap[v]);
    const vertices = MeshoptEncoder.encodeVertexBuffer(new Uint8Array(sorted.buffer), unique, 8);
    const triangles = MeshoptEncoder.encodeIndexBuffer(new Uint8Array(indices.buffer), indices.length, 4);
    return [Buffer.concat([vertices, triangles]), { vertices, triangles, unique, indices: indices.length }];
  });
  const [, decodeSecs] = seconds(() => {
    MeshoptDecoder.decodeVertexBuffer(new Uint8Array(coded.unique * 8), coded.unique, 8, coded.vertices);
    MeshoptDecoder.decodeIndexBuffer(new Uint8Array(coded.indices * 4), coded.indices, 4, coded.triangles);
  });
  say(name, 'meshopt', bits, packed.length, encodeSecs, decodeSecs);
  const [small, secs] = seconds(() => brotli(packed));
  say(name, 'meshopt + brotli', bits, small.length, (Number(encodeSecs) + Number(secs)).toFixed(4), '-');
}

function plain(name, mesh, bits) {
  const points = grid(mesh, bits);
  const packed = new Uint16Array(mesh.vertices * 3);
  for (let v = 0; v < mesh.vertices; v++) packed.set(points.subarray(4 * v, 4 * v + 3), 3 * v);
  const bytes = Buffer.concat([Buffer.from(packed.buffer), Buffer.from(mesh.indices.buffer)]);
  const coders = { gzip: (b) => zlib.gzipSync(b), brotli, ...(zlib.zstdCompressSync && { zstd: (b) => zlib.zstdCompressSync(b) }) };
  for (const [coder, pack] of Object.entries(coders)) {
    const [out, secs] = seconds(() => pack(bytes));
    say(name, `plain + ${coder}`, bits, out.length, secs, '-');
  }
}

globalThis.OffscreenCanvas ??= class {};
const ours = await import(pathToFileURL(path.join(pkg, 'pmesh.js')));
ours.initSync({ module: fs.readFileSync(path.join(pkg, 'pmesh_bg.wasm')) });

for (const file of fs.readdirSync(folder).filter((f) => f.endsWith('.raw')).sort()) {
  const name = file.slice(0, -4);
  const mesh = read(path.join(folder, file));
  for (const bits of [12, 10, 11, 14, 16]) draco(name, mesh, 10, bits);
  draco(name, mesh, 7, 12);
  meshopt(name, mesh, 12);
  plain(name, mesh, 12);
  for (const stream of ['prefix', 'size', 'fast']) {
    const bytes = new Uint8Array(fs.readFileSync(path.join(folder, `${name}.${stream}.12.pmesh`)));
    const model = new ours.Model();
    const [, secs] = seconds(() => {
      model.push(bytes);
      model.finish();
    });
    model.free();
    say(name, `${stream} wasm`, 12, bytes.length, '-', secs);
  }
}
