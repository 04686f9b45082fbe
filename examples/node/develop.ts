/**
 * Develop a photograph with a portable camera, outside of a browser.
 *
 *   node develop.mjs CAMERA PHOTO PICTURE [--size S|M] [--iso N] [--gains R,B] [--origin X,Y]
 *                    [--bits 8|16] [--light FILE] [--wasm]
 */
import { readdir, readFile, stat, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { parseArgs } from "node:util";
import { Camera, type Runtime } from "../core/camera.js";
import { readDng } from "../core/dng.js";
import { check, FileError } from "../core/error.js";
import { picture } from "../core/picture.js";
import { isPng, readMosaic, writePng } from "../core/png.js";
import { develop } from "../core/reader.js";
import { readZip } from "../core/zip.js";

async function readCamera(path: string): Promise<Map<string, Uint8Array>> {
  if (!(await stat(path)).isDirectory()) return readZip(await readFile(path));
  const entries = await readdir(path, { withFileTypes: true });
  const names = entries.filter((entry) => entry.isFile()).map((entry) => entry.name);
  return new Map(await Promise.all(names.map(async (name) => [name, new Uint8Array(await readFile(join(path, name)))] as const)));
}

/** onnxruntime for this machine, or as WebAssembly, which runs everywhere. */
async function loadRuntime(wasm: boolean): Promise<Runtime> {
  if (!wasm) return import("onnxruntime-node");
  const ort = await import("onnxruntime-web");
  ort.env.wasm.numThreads = 1;
  return ort;
}

function numbers(text: string, count: number, what: string): number[] {
  const values = text.split(",").map(Number);
  check(values.length === count && values.every(Number.isFinite), `${what} must be ${count} numbers; got ${text}.`);
  return values;
}

async function main(): Promise<void> {
  const { values, positionals } = parseArgs({
    allowPositionals: true,
    options: {
      size: { type: "string", default: "S" },
      iso: { type: "string" },
      gains: { type: "string" },
      origin: { type: "string" },
      bits: { type: "string", default: "8" },
      light: { type: "string" },
      wasm: { type: "boolean", default: false },
    },
  });
  const [cameraPath, photoPath, picturePath] = positionals;
  check(cameraPath && photoPath && picturePath, "Give a camera, a photograph and the PNG to write.");
  const camera = Camera.open(await readCamera(cameraPath), await loadRuntime(values.wasm), { intraOpNumThreads: 1 });
  const bytes = new Uint8Array(await readFile(photoPath));
  const capture = isPng(bytes) ? await readMosaic(bytes) : readDng(bytes);
  if (values.iso) {
    capture.iso = numbers(values.iso, 1, "The ISO")[0]!;
    delete capture.noise;
  }
  if (values.gains) {
    const [red, blue] = numbers(values.gains, 2, "Gains");
    capture.whiteBalance = [red!, 1, blue!];
  }
  if (values.origin) capture.origin = numbers(values.origin, 2, "The origin") as [number, number];
  const started = process.cpuUsage();
  const start = performance.now();
  const made = await develop(camera, capture, { size: values.size });
  const { user, system } = process.cpuUsage(started);
  const seconds = ((performance.now() - start) / 1000).toFixed(2);
  console.log(`${made.width}x${made.height}: ${seconds} s, ${((user + system) / 1e6).toFixed(2)} CPU s`);
  const { light } = made;
  if (values.light) await writeFile(values.light, new Uint8Array(light.buffer, light.byteOffset, light.byteLength));
  const { rgb, width, height } = picture(light, made, values.bits === "16" ? 16 : 8);
  await writeFile(picturePath, await writePng(rgb, width, height));
}

main().catch((error: unknown) => {
  console.error(error instanceof FileError ? error.message : error);
  process.exitCode = 1;
});
