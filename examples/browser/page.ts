/** The page: what a person gives, does and sees. The work is done in worker.ts. */
import glue from "onnxruntime-web/ort-wasm-simd-threaded.mjs";
import wasmPacked from "camkit:wasm";
import workerCode from "camkit:worker";
import type { Answer, CameraFacts, Order, PhotoFacts, Pixels, Settings } from "./messages.js";

const MOST_THREADS = 8;

function element<K extends keyof HTMLElementTagNameMap>(id: string, kind: K): HTMLElementTagNameMap[K] {
  const found = document.getElementById(id);
  if (found?.localName !== kind) throw new Error(`the page has no ${kind} ${id}`);
  return found as HTMLElementTagNameMap[K];
}

const drop = element("drop", "div");
const files = element("files", "input");
const form = element("settings", "form");
const size = element("size", "select");
const [iso, red, blue, left, top] = ["iso", "red", "blue", "left", "top"].map((id) => element(id, "input")) as [HTMLInputElement, HTMLInputElement, HTMLInputElement, HTMLInputElement, HTMLInputElement];
const developButton = element("develop", "button");
const cancelButton = element("cancel", "button");
const saveButtons = { 8: element("save8", "button"), 16: element("save16", "button") };
const work = element("work", "div");
const bar = element("bar", "progress");
const stage = element("stage", "div");
const before = element("before", "canvas");
const after = element("after", "canvas");
const line = element("line", "div");
const split = element("split", "input");
const zoom = element("zoom", "button");
const stops = element("stops", "input");
const news = element("news", "p");
const problem = element("error", "p");

let worker: Worker | undefined;
let wasm: ArrayBuffer | undefined;
/** Files that were given, and the names of those in use: a new worker needs them after a cancel. */
const given = new Map<string, ArrayBuffer>();
const used = { camera: [] as string[], photo: [] as string[] };
let camera: CameraFacts | undefined;
let photo: PhotoFacts | undefined;
let started = 0;
let isAgain = false; // what the worker reads is known: it is a new one, after a cancel

const threads = crossOriginIsolated ? Math.min(navigator.hardwareConcurrency || 1, MOST_THREADS) : 1;

/** Unpack the WebAssembly that the page carries. */
async function unpack(): Promise<ArrayBuffer> {
  const text = atob(wasmPacked);
  const bytes = Uint8Array.from({ length: text.length }, (_, i) => text.charCodeAt(i));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

function send(order: Order): void {
  worker?.postMessage(order);
}

async function startWorker(): Promise<void> {
  wasm ??= await unpack();
  worker?.terminate();
  const address = URL.createObjectURL(new Blob([workerCode], { type: "text/javascript" }));
  worker = new Worker(address);
  worker.onmessage = ({ data }: MessageEvent<Answer>) => hear(data);
  worker.onerror = (event) => fail(`Something went wrong: ${event.message}`);
  send({ kind: "start", wasm, glue, threads });
  const names = [...used.camera, ...used.photo];
  if (names.length) send({ kind: "files", files: names.map((name) => ({ name, bytes: given.get(name)! })) });
}

/** Show what is wrong; work goes on only if it is said. */
function fail(message: string, goesOn = false): void {
  problem.textContent = message;
  problem.hidden = false;
  if (!goesOn) rest();
}

/** Show that nothing is being done. */
function rest(): void {
  work.hidden = cancelButton.hidden = true;
  developButton.disabled = false;
  for (const button of Object.values(saveButtons)) button.disabled = false;
}

function hear(message: Answer): void {
  switch (message.kind) {
    case "ready":
      element("engine", "footer").textContent = `Ready, on ${message.threads === 1 ? "one thread" : `${message.threads} threads`}.`;
      break;
    case "camera":
      camera = message.facts;
      used.camera = message.files;
      if (!isAgain) showGiven();
      break;
    case "photo":
      photo = message.facts;
      used.photo = [photo.name];
      if (!isAgain) showGiven();
      break;
    case "progress":
      showProgress(message.step, message.share);
      break;
    case "done":
      rest();
      news.textContent = `Done in ${message.seconds.toFixed(1)} s.`;
      send({ kind: "show", stops: stops.valueAsNumber });
      break;
    case "shown":
      paint(before, message.before);
      paint(after, message.after);
      element("result", "section").hidden = false;
      place();
      break;
    case "saved":
      download(new Blob([message.png], { type: "image/png" }), message.bits);
      break;
    case "light":
      dispatchEvent(new CustomEvent("light", { detail: message }));
      break;
    case "error":
      fail(message.message);
  }
}

function showGiven(): void {
  const cameraText = element("camera", "dd");
  const photoText = element("photo", "dd");
  if (camera) cameraText.textContent = `${camera.name} ${camera.version}, sensor of ${camera.sensor.join(" x ")} px`;
  if (photo) photoText.textContent = [photo.name, `${photo.width} x ${photo.height} px`, photo.camera, photo.iso && `ISO ${photo.iso}`, ...photo.notes].filter(Boolean).join(", ");
  cameraText.classList.toggle("dim", !camera);
  photoText.classList.toggle("dim", !photo);
  form.hidden = !(camera && photo);
  if (!camera || !photo) return;
  size.replaceChildren(...camera.sizes.map((name) => new Option(`${name}${name === "S" ? ", fast" : name === "M" ? ", better" : ""}`, name)));
  iso.value = photo.iso ? String(photo.iso) : "";
  red.value = rounded(photo.whiteBalance?.[0]);
  blue.value = rounded(photo.whiteBalance?.[2]);
  left.value = String(photo.origin?.[0] ?? Math.max(0, 2 * Math.floor((camera.sensor[0] - photo.width) / 4)));
  top.value = String(photo.origin?.[1] ?? Math.max(0, 2 * Math.floor((camera.sensor[1] - photo.height) / 4)));
  const stranger = photo.bundle !== camera.name && photo.camera ? `This photograph names the camera ${photo.bundle ?? photo.camera}, not ${camera.name}: the picture may be worse than the photograph.` : "";
  news.textContent = [stranger, photo.iso && photo.whiteBalance ? "" : "The file does not state everything: fill in the empty fields."].filter(Boolean).join(" ");
}

function showProgress(step: string, share: number): void {
  const seconds = (performance.now() - started) / 1000;
  bar.value = share;
  const rest = share > 0.05 ? `, about ${Math.ceil((seconds / share) * (1 - share))} s left` : "";
  element("doing", "p").textContent = `${step}: ${Math.floor(100 * share)} %, ${Math.floor(seconds)} s so far${rest}`;
}

function paint(canvas: HTMLCanvasElement, { rgba, width, height }: Pixels): void {
  [canvas.width, canvas.height] = [width, height];
  canvas.getContext("2d")?.putImageData(new ImageData(rgba, width, height), 0, 0);
}

/** Lay the pictures out, and the line between before and after where the slider says. */
function place(): void {
  const fit = stage.classList.contains("fit");
  const room = stage.parentElement!.clientWidth;
  const scale = fit ? Math.min(1, room / after.width, (0.8 * innerHeight) / after.height) : 1 / devicePixelRatio;
  for (const canvas of [before, after]) canvas.style.width = `${after.width * scale}px`;
  const seen = Math.min(stage.clientWidth, after.clientWidth);
  const at = (stage.scrollWidth > stage.clientWidth ? stage.scrollLeft : 0) + (Number(split.value) / 100) * seen;
  after.style.clipPath = `inset(0 0 0 ${at}px)`;
  line.style.left = `${at}px`;
}

function download(blob: Blob, bits: number): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${(photo?.name ?? "picture").replace(/\.\w+$/, "")}_${bits}.png`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  rest();
  news.textContent = `Saved ${link.download}.`;
}

async function take(list: File[]): Promise<void> {
  if (!list.length) return;
  if (!work.hidden) return fail("A photograph is being developed. Wait, or cancel it first.", true);
  problem.hidden = true;
  isAgain = false;
  news.textContent = "Reading the files.";
  const taken = await Promise.all(list.map(async (file) => ({ name: file.name, bytes: await file.arrayBuffer() })));
  for (const name of given.keys()) if (![...used.camera, ...used.photo].includes(name)) given.delete(name);
  for (const { name, bytes } of taken) given.set(name, bytes);
  news.textContent = "";
  send({ kind: "files", files: taken });
}

/** All files of what was dropped, those in folders too. */
async function dropped(transfer: DataTransfer): Promise<File[]> {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry()).filter((entry) => entry !== null);
  const found: File[] = [];
  while (entries.length) {
    const entry = entries.shift()!;
    if (entry.isFile) found.push(await new Promise<File>((done, failed) => (entry as FileSystemFileEntry).file(done, failed)));
    else entries.push(...(await new Promise<FileSystemEntry[]>((done, failed) => (entry as FileSystemDirectoryEntry).createReader().readEntries(done, failed))));
  }
  return found;
}

function rounded(gain: number | undefined): string {
  return gain === undefined ? "" : String(Number(gain.toFixed(4)));
}

/** A gain that a person typed, or that of the file in full where it still stands there. */
function gain(input: HTMLInputElement, stated: number | undefined): number {
  return stated !== undefined && input.value === rounded(stated) ? stated : input.valueAsNumber;
}

function settings(): Settings {
  return {
    size: size.value,
    iso: iso.valueAsNumber,
    whiteBalance: [gain(red, photo?.whiteBalance?.[0]), 1, gain(blue, photo?.whiteBalance?.[2])],
    origin: [left.valueAsNumber, top.valueAsNumber],
  };
}

files.addEventListener("change", () => {
  void take([...(files.files ?? [])]);
  files.value = "";
});
addEventListener("dragover", (event) => {
  event.preventDefault();
  drop.classList.add("over");
});
addEventListener("dragleave", () => drop.classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  drop.classList.remove("over");
  if (event.dataTransfer) void dropped(event.dataTransfer).then(take);
});
form.addEventListener("submit", (event) => {
  event.preventDefault();
  problem.hidden = true;
  work.hidden = cancelButton.hidden = false;
  developButton.disabled = true;
  news.textContent = "";
  started = performance.now();
  showProgress("Loading the graphs", 0);
  send({ kind: "develop", settings: settings() });
});
cancelButton.addEventListener("click", () => {
  rest();
  problem.hidden = true;
  news.textContent = "Cancelled.";
  isAgain = true;
  developButton.focus();
  void startWorker();
});
for (const bits of [8, 16] as const) {
  saveButtons[bits].addEventListener("click", () => {
    for (const button of Object.values(saveButtons)) button.disabled = true;
    news.textContent = "Writing the PNG.";
    send({ kind: "save", bits, stops: stops.valueAsNumber });
  });
}
zoom.addEventListener("click", () => {
  const fit = stage.classList.toggle("fit");
  zoom.textContent = fit ? "Show at 100 %" : "Fit into the page";
  zoom.setAttribute("aria-pressed", String(!fit));
  place();
});
stops.addEventListener("input", () => {
  element("stated", "output").textContent = `${stops.valueAsNumber > 0 ? "+" : ""}${stops.value} EV`;
});
stops.addEventListener("change", () => send({ kind: "show", stops: stops.valueAsNumber }));
split.addEventListener("input", place);
stage.addEventListener("scroll", place);
addEventListener("resize", place);
line.addEventListener("pointerdown", (event) => line.setPointerCapture(event.pointerId));
line.addEventListener("pointermove", (event) => {
  if (!line.hasPointerCapture(event.pointerId)) return;
  const seen = stage.scrollWidth > stage.clientWidth ? stage : after;
  const box = seen.getBoundingClientRect();
  split.value = String((100 * (event.clientX - box.left)) / seen.clientWidth);
  place();
});
stage.classList.add("fit");
// for scripts: the developed light, as the event "light" of the window
addEventListener("askforlight", () => send({ kind: "light" }));
void startWorker().catch((error: unknown) => fail(`The page cannot start: ${String(error)}`));
