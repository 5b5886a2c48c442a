// Decodes a base-colour image to pixels, a band of rows a task, so that a large one never holds the page up.

/** Largest side of a texture; larger images are scaled down. */
const MAX_SIDE = 4096;
/** Pixels a task. */
const BAND_PIXELS = 1 << 17;

/** The image as { width, height, pixels: red green blue alpha bytes, rows from the top }, or null once `wanted()` is false. */
export async function decodeImage(bytes, type, wanted) {
  const bitmap = await createImageBitmap(new Blob([bytes], { type }));
  const scale = Math.min(1, MAX_SIDE / Math.max(bitmap.width, bitmap.height));
  const [width, height] = [bitmap.width, bitmap.height].map((n) => Math.max(1, Math.round(n * scale)));
  const rows = Math.max(1, Math.floor(BAND_PIXELS / width));
  const pixels = new Uint8Array(width * height * 4);
  // Read back at once, so kept out of the GPU.
  const context = new OffscreenCanvas(width, Math.min(rows, height)).getContext("2d", { willReadFrequently: true });
  context.globalCompositeOperation = "copy";
  for (let y = 0; y < height; y += rows) {
    if (!wanted()) return null;
    const count = Math.min(rows, height - y);
    context.drawImage(bitmap, 0, -y, width, height);
    pixels.set(context.getImageData(0, 0, width, count).data, y * width * 4);
    await new Promise((resolve) => setTimeout(resolve));
  }
  bitmap.close();
  return { width, height, pixels };
}
