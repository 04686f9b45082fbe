/** PNG: grey mosaics are read, pictures of 8 or 16 bits are written (PNG specification, 3rd edition). */
import type { Capture } from "./capture.js";
import { check } from "./error.js";

const SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];
const DAMAGED = "The PNG is damaged: its samples cannot be read.";

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});

/** CRC-32 of bytes, as PNG and zip have it. */
export function crc32(bytes: Uint8Array): number {
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) crc = TABLE[(crc ^ bytes[i]!) & 255]! ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}

/** Send bytes through a stream that packs or unpacks them; more than `most` bytes are an error. */
export async function through(bytes: Uint8Array, stream: CompressionStream | DecompressionStream, most = Infinity): Promise<Uint8Array> {
  let left = most;
  const bound = new TransformStream<Uint8Array, Uint8Array>({
    transform: (part, controller) => ((left -= part.length) < 0 ? controller.error(new RangeError("too long")) : controller.enqueue(part)),
  });
  const source = new Blob([bytes as Uint8Array<ArrayBuffer>]).stream();
  return new Uint8Array(await new Response(source.pipeThrough(stream).pipeThrough(bound)).arrayBuffer());
}

export function isPng(bytes: Uint8Array): boolean {
  return SIGNATURE.every((byte, i) => bytes[i] === byte);
}

/** Read the samples of a sensor from a grey PNG of 8 or 16 bits. */
export async function readMosaic(bytes: Uint8Array): Promise<Capture> {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const parts: Uint8Array[] = [];
  for (let at = 8; at + 12 <= bytes.length; ) {
    const length = view.getUint32(at);
    check(at + 12 + length <= bytes.length, DAMAGED);
    if (view.getUint32(at + 4) === 0x49444154) parts.push(bytes.subarray(at + 8, at + 8 + length)); // IDAT
    at += 12 + length;
  }
  check(bytes.length >= 33 && parts.length, DAMAGED);
  const width = view.getUint32(16);
  const height = view.getUint32(20);
  const [bits, colour, , , interlace] = bytes.subarray(24, 29);
  check(colour === 0 && (bits === 8 || bits === 16) && interlace === 0, "The PNG is no mosaic: a mosaic is grey, of 8 or 16 bits, not interlaced. Drop the samples of the sensor, not a picture.");
  check(width >= 2 && height >= 2 && width * height <= 1000 * bytes.length, DAMAGED);
  const packed = new Uint8Array(await new Blob(parts as Uint8Array<ArrayBuffer>[]).arrayBuffer());
  const step = bits / 8;
  const row = width * step;
  const data = await through(packed, new DecompressionStream("deflate"), height * (row + 1)).catch(() => undefined);
  check(data && data.length >= height * (row + 1), DAMAGED);
  const samples = new Uint16Array(width * height);
  let above: Uint8Array = new Uint8Array(row);
  for (let y = 0; y < height; y++) {
    const start = y * (row + 1);
    const line = data.subarray(start + 1, start + 1 + row);
    unfilter(line, above, data[start]!, step);
    for (let x = 0; x < width; x++) samples[y * width + x] = bits === 8 ? line[x]! : (line[2 * x]! << 8) | line[2 * x + 1]!;
    above = line;
  }
  return { samples, width, height, orientation: 1, camera: "", notes: [] };
}

function unfilter(line: Uint8Array, above: Uint8Array, filter: number, step: number): void {
  check(filter <= 4, DAMAGED);
  for (let i = 0; i < line.length; i++) {
    const a = i < step ? 0 : line[i - step]!;
    const b = above[i]!;
    if (filter === 1) line[i]! += a;
    else if (filter === 2) line[i]! += b;
    else if (filter === 3) line[i]! += (a + b) >> 1;
    else if (filter === 4) {
      const c = i < step ? 0 : above[i - step]!;
      const [pa, pb, pc] = [Math.abs(b - c), Math.abs(a - c), Math.abs(a + b - 2 * c)];
      line[i]! += pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
    }
  }
}

/** Write an sRGB picture: red, green and blue of a pixel side by side, 8 bits or 16. */
export async function writePng(rgb: Uint8Array | Uint16Array, width: number, height: number): Promise<Uint8Array> {
  const step = 3 * rgb.BYTES_PER_ELEMENT;
  const row = width * step;
  const data = new Uint8Array(height * (row + 1));
  for (let y = 0; y < height; y++) {
    const start = y * (row + 1);
    const line = data.subarray(start + 1, start + 1 + row);
    for (let i = 0; i < 3 * width; i++) {
      const value = rgb[3 * y * width + i]!;
      if (step === 3) line[i] = value;
      else [line[2 * i], line[2 * i + 1]] = [value >> 8, value & 255];
    }
    data[start] = 1; // each byte less that of the pixel to its left
    for (let i = row - 1; i >= step; i--) line[i]! -= line[i - step]!;
  }
  const header = new Uint8Array(13);
  const view = new DataView(header.buffer);
  view.setUint32(0, width);
  view.setUint32(4, height);
  header.set([8 * rgb.BYTES_PER_ELEMENT, 2], 8);
  const packed = await through(data, new CompressionStream("deflate"));
  const chunks = [chunk("IHDR", header), chunk("sRGB", Uint8Array.of(0)), chunk("IDAT", packed), chunk("IEND", new Uint8Array())];
  return new Uint8Array(await new Blob([Uint8Array.from(SIGNATURE), ...chunks] as BlobPart[]).arrayBuffer());
}

function chunk(name: string, body: Uint8Array): Uint8Array {
  const out = new Uint8Array(12 + body.length);
  const view = new DataView(out.buffer);
  view.setUint32(0, body.length);
  out.set(new TextEncoder().encode(name), 4);
  out.set(body, 8);
  view.setUint32(8 + body.length, crc32(out.subarray(4, 8 + body.length)));
  return out;
}
