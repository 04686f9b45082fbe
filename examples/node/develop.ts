/** Develop a photograph with a portable camera, outside of a browser; `--help` says how. */
import { existsSync } from "node:fs";
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

const USAGE = `usage: node develop.mjs CAMERA PHOTO PICTURE [OPTIONS]

CAMERA   folder or zip that \`camkit portable\` wrote
PHOTO    DNG, or a mosaic as a grey PNG
PICTURE  PNG to write

  --size S                of the network; default: M
  --iso N                 where the photograph states none, or another one holds
  --white-balance R,G,B   gains
  --origin-px X,Y         of the first pixel on the sensor
  --bits 8|16             of the PNG; default: 8
  --light FILE            also write the linear light: three planes of float32
  --wasm                  run onnxruntime as WebAssembly
  --overwrite             replace files that exist`;

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
  check(values.length === count && values.every(Number.isFinite), `${what} takes ${count} number${count > 1 ? "s" : ""}; got ${text}.`);
  return values;
}

function readWords() {
  try {
    return parseArgs({
      allowPositionals: true,
      options: {
        size: { type: "string", default: "M" },
        iso: { type: "string" },
        "white-balance": { type: "string" },
        "origin-px": { type: "string" },
        bits: { type: "string", default: "8" },
        light: { type: "string" },
        wasm: { type: "boolean", default: false },
        overwrite: { type: "boolean", default: false },
        help: { type: "boolean", short: "h", default: false },
      },
    });
  } catch (error) {
    throw new FileError((error as Error).message.split(". ")[0]! + "; --help lists the options.");
  }
}

async function main(): Promise<void> {
  const { values, positionals } = readWords();
  if (values.help) return console.log(USAGE);
  const [cameraPath, photoPath, picturePath] = positionals;
  check(cameraPath && photoPath && picturePath && positionals.length === 3, `Give a camera, a photograph and the PNG to write.\n\n${USAGE}`);
  for (const path of [picturePath, values.light]) {
    check(!path || values.overwrite || !existsSync(path), `${path} exists; add --overwrite, or write another file.`);
  }
  const camera = Camera.open(await readCamera(cameraPath), await loadRuntime(values.wasm), { intraOpNumThreads: 1 });
  const bytes = new Uint8Array(await readFile(photoPath));
  const capture = isPng(bytes) ? await readMosaic(bytes) : readDng(bytes);
  if (values.iso) {
    capture.iso = numbers(values.iso, 1, "--iso")[0]!;
    delete capture.noise;
  }
  const balance = values["white-balance"];
  if (balance) capture.whiteBalance = numbers(balance, 3, "--white-balance") as [number, number, number];
  const origin = values["origin-px"];
  if (origin) capture.origin = numbers(origin, 2, "--origin-px") as [number, number];
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
