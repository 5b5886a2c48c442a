// What the scripts beside have in common: meshes as plain numbers, Draco, and how figures are printed.
import fs from 'node:fs';
import path from 'node:path';
import { createRequire } from 'node:module';

/** The result of some work, and its seconds as text. */
export function seconds(work) {
  const start = performance.now();
  const out = work();
  return [out, ((performance.now() - start) / 1000).toFixed(4)];
}

/** Prints a line of the table. */
export const say = (...words) => process.stdout.write(`${words.join('\t')}\n`);

/** Finds packages in PACKAGES/node_modules. */
export const packagesIn = (folder) => createRequire(path.join(folder, 'package.json'));

/** A mesh as the native benchmark writes it: counts, positions, indices. */
export function read(file) {
  const bytes = fs.readFileSync(file);
  const [vertices, triangles] = new Uint32Array(bytes.buffer, bytes.byteOffset, 2);
  const positions = new Float32Array(bytes.buffer.slice(bytes.byteOffset + 8, bytes.byteOffset + 8 + 12 * vertices));
  const from = bytes.byteOffset + 8 + 12 * vertices;
  return { vertices, triangles, positions, indices: new Uint32Array(bytes.buffer.slice(from, from + 12 * triangles)) };
}

/** The same the other way. */
export function write(file, mesh) {
  const counts = new Uint32Array([mesh.vertices, mesh.triangles]);
  fs.writeFileSync(file, Buffer.concat([counts, mesh.positions, mesh.indices].map((a) => Buffer.from(a.buffer, a.byteOffset, a.byteLength))));
}

/** Draco's two directions: encode(mesh, level, bits) to bytes, decode(bytes) to a mesh. */
export async function loadDraco(require) {
  const e = await require('draco3d').createEncoderModule({});
  const d = await require('draco3d').createDecoderModule({});
  const encode = (mesh, level, bits) => {
    const [encoder, builder, out, target] = [new e.Encoder(), new e.MeshBuilder(), new e.DracoInt8Array(), new e.Mesh()];
    builder.AddFacesToMesh(target, mesh.triangles, mesh.indices);
    builder.AddFloatAttributeToMesh(target, e.POSITION, mesh.vertices, 3, mesh.positions);
    encoder.SetSpeedOptions(10 - level, 10 - level);
    encoder.SetEncodingMethod(e.MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeQuantization(e.POSITION, bits);
    const size = encoder.EncodeMeshToDracoBuffer(target, out);
    const bytes = new Int8Array(size);
    for (let i = 0; i < size; i++) bytes[i] = out.GetValue(i);
    [encoder, builder, out, target].forEach((x) => e.destroy(x));
    return bytes;
  };
  const decode = (bytes) => {
    const [decoder, buffer, target] = [new d.Decoder(), new d.DecoderBuffer(), new d.Mesh()];
    buffer.Init(bytes, bytes.length);
    if (!decoder.DecodeBufferToMesh(buffer, target).ok()) throw new Error('Draco does not decode what it wrote');
    const [triangles, vertices] = [target.num_faces(), target.num_points()];
    const [corners, floats] = [d._malloc(triangles * 12), d._malloc(vertices * 12)];
    decoder.GetTrianglesUInt32Array(target, triangles * 12, corners);
    const attribute = decoder.GetAttribute(target, decoder.GetAttributeId(target, d.POSITION));
    decoder.GetAttributeDataArrayForAllPoints(target, attribute, d.DT_FLOAT32, vertices * 12, floats);
    const indices = new Uint32Array(d.HEAPU32.buffer, corners, triangles * 3).slice();
    const positions = new Float32Array(d.HEAPF32.buffer, floats, vertices * 3).slice();
    [corners, floats].forEach((p) => d._free(p));
    [decoder, buffer, target].forEach((x) => d.destroy(x));
    return { vertices, triangles, positions, indices };
  };
  return { encode, decode };
}
