/** The work behind the page: files are read and photographs developed here, so that the page stays alive. */
import * as ort from "onnxruntime-web/wasm";
import { Camera } from "../core/camera.js";
import type { Capture } from "../core/capture.js";
import { readDng } from "../core/dng.js";
import { check, FileError } from "../core/error.js";
import { picture } from "../core/picture.js";
import { isPng, readMosaic, writePng } from "../core/png.js";
import { develop, type Developed } from "../core/reader.js";
import { isZip, readZip } from "../core/zip.js";
import type { Answer, Order, Pixels, Settings } from "./messages.js";

let camera: Camera | undefined;
let capture: Capture | undefined;
let made: Developed | undefined;

function answer(message: Answer, moved: Transferable[] = []): void {
  (self as unknown as Worker).postMessage(message, moved);
}

function start(order: Extract<Order, { kind: "start" }>): void {
  const { wasm } = ort.env;
  wasm.wasmBinary = order.wasm;
  wasm.wasmPaths = { mjs: URL.createObjectURL(new Blob([order.glue], { type: "text/javascript" })) };
  wasm.numThreads = order.threads;
  answer({ kind: "ready", threads: order.threads });
}

async function take(files: { name: string; bytes: ArrayBuffer }[]): Promise<void> {
  const isMember = ({ name }: { name: string }) => /\.(zip|json|onnx|safetensors)$/i.test(name);
  const photos = files.filter((file) => !isMember(file));
  const errors: unknown[] = []; // one file that cannot be used does not stop the others
  for (const { name, bytes } of photos) await takePhoto(name, new Uint8Array(bytes)).catch((error: unknown) => errors.push(error));
  const members = files.filter(isMember);
  if (members.length) await takeCamera(members).catch((error: unknown) => errors.push(error));
  if (errors.length) throw errors[0];
}

async function takeCamera(files: { name: string; bytes: ArrayBuffer }[]): Promise<void> {
  const members = new Map<string, Uint8Array>();
  for (const file of files) {
    const bytes = new Uint8Array(file.bytes);
    if (isZip(bytes)) for (const [name, content] of await readZip(bytes)) members.set(name, content);
    else members.set(file.name, bytes);
  }
  camera = Camera.open(members, ort);
  const { camera: named, networks, sensor } = camera.about;
  const facts = { name: named.name, version: named.version, sizes: Object.keys(networks), sensor: sensor.size_px };
  answer({ kind: "camera", facts, files: files.map(({ name }) => name) });
}

async function takePhoto(name: string, bytes: Uint8Array): Promise<void> {
  try {
    capture = isPng(bytes) ? await readMosaic(bytes) : readDng(bytes);
  } catch (error) {
    if (error instanceof FileError) throw new FileError(`${name}: ${error.message}`);
    throw error;
  }
  const { samples: _, cfa: __, noise: ___, black: ____, white: _____, orientation: ______, ...facts } = capture;
  answer({ kind: "photo", facts: { ...facts, name } });
}

function pixels(light: Float32Array, of: Developed, stops: number): Pixels {
  const { rgb, width, height } = picture(light, of, 8, stops);
  const rgba = new Uint8ClampedArray(4 * width * height).fill(255);
  for (let i = 0, j = 0; j < rgb.length; i += 4, j += 3) [rgba[i], rgba[i + 1], rgba[i + 2]] = [rgb[j]!, rgb[j + 1]!, rgb[j + 2]!];
  return { rgba, width, height };
}

async function work(settings: Settings): Promise<void> {
  check(camera && capture, "Drop a camera and a photograph first.");
  const started = performance.now();
  const { noise, ...rest } = capture;
  const kept = noise && capture.iso === settings.iso && { noise }; // another ISO has other noise
  made = await develop(camera, { ...rest, ...kept, ...settings }, {
    size: settings.size,
    progress: (step, share) => answer({ kind: "progress", step, share }),
  });
  answer({ kind: "done", seconds: (performance.now() - started) / 1000 });
}

function show(stops: number): void {
  check(made, "Develop a photograph first.");
  const before = pixels(made.before, made, stops);
  const after = pixels(made.light, made, stops);
  answer({ kind: "shown", before, after }, [before.rgba.buffer, after.rgba.buffer]);
}

async function save(bits: 8 | 16, stops: number): Promise<void> {
  check(made, "Develop a photograph first.");
  const { rgb, width, height } = picture(made.light, made, bits, stops);
  const png = (await writePng(rgb, width, height)).buffer as ArrayBuffer;
  answer({ kind: "saved", png, bits }, [png]);
}

async function obey(order: Order): Promise<void> {
  switch (order.kind) {
    case "start": return start(order);
    case "files": return take(order.files);
    case "develop": return work(order.settings);
    case "show": return show(order.stops);
    case "save": return save(order.bits, order.stops);
    case "light":
      check(made, "Develop a photograph first.");
      return answer({ kind: "light", light: made.light, width: made.width, height: made.height });
  }
}

let last: Promise<void> = Promise.resolve();
self.onmessage = ({ data }: MessageEvent<Order>) => {
  last = last.then(() => obey(data)).catch((error: unknown) => {
    const known = error instanceof FileError;
    const memory = error instanceof RangeError || /memory|bad_alloc/i.test(String(error));
    const message = known ? error.message : memory ? "There is not enough memory for a photograph of this size. Close other pages, or cut the photograph." : `Something went wrong: ${error instanceof Error ? error.message : String(error)}`;
    answer({ kind: "error", message });
  });
};
