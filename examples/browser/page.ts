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
const news = element("news", "p");
const problem = element("error", "p");

let worker: Worker | undefined;
let wasm: ArrayBuffer | undefined;
let given: { name: string; bytes: ArrayBuffer }[] = []; // for a new worker, after a cancel
let camera: CameraFacts | undefined;
let photo: PhotoFacts | undefined;
let started = 0;

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
  if (given.length) send({ kind: "files", files: given });
}

function fail(message: string): void {
  problem.textContent = message;
  problem.hidden = false;
  rest();
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
      showGiven();
      break;
    case "photo":
      photo = message.facts;
      showGiven();
      break;
    case "progress":
      showProgress(message.step, message.share);
      break;
    case "before":
      paint(before, message.pixels);
      break;
    case "after":
      paint(after, message.pixels);
      showResult(message.seconds);
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
  const cameraText = element("camera", "dd" as "div");
  const photoText = element("photo", "dd" as "div");
  if (camera) cameraText.textContent = `${camera.name} ${camera.version}, sensor of ${camera.sensor.join(" x ")} px`;
  if (photo) photoText.textContent = [photo.name, `${photo.width} x ${photo.height} px`, photo.camera, photo.iso && `ISO ${photo.iso}`, ...photo.notes].filter(Boolean).join(", ");
  cameraText.classList.toggle("dim", !camera);
  photoText.classList.toggle("dim", !photo);
  form.hidden = !(camera && photo);
  if (!camera || !photo) return;
  size.replaceChildren(...camera.sizes.map((name) => new Option(`${name}${name === "S" ? ", fast" : name === "M" ? ", better" : ""}`, name)));
  iso.value = photo.iso ? String(photo.iso) : "";
  red.value = photo.whiteBalance ? String(photo.whiteBalance[0]) : "";
  blue.value = photo.whiteBalance ? String(photo.whiteBalance[2]) : "";
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

function showResult(seconds: number): void {
  rest();
  element("result", "section").hidden = false;
  news.textContent = `Done in ${seconds.toFixed(1)} s.`;
  place();
}

function paint(canvas: HTMLCanvasElement, { rgba, width, height }: Pixels): void {
  [canvas.width, canvas.height] = [width, height];
  canvas.getContext("2d")?.putImageData(new ImageData(rgba, width, height), 0, 0);
}

/** Put the line between before and after where the slider says, on what is seen of the picture. */
function place(): void {
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
  problem.hidden = true;
  if (!list.length) return;
  news.textContent = "Reading the files.";
  const taken = await Promise.all(list.map(async (file) => ({ name: file.name, bytes: await file.arrayBuffer() })));
  given = [...given.filter(({ name }) => !taken.some((one) => one.name === name)), ...taken];
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

function settings(): Settings {
  return {
    size: size.value,
    iso: iso.valueAsNumber,
    whiteBalance: [red.valueAsNumber, 1, blue.valueAsNumber],
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
  news.textContent = "Cancelled.";
  developButton.focus();
  void startWorker();
});
for (const bits of [8, 16] as const) {
  saveButtons[bits].addEventListener("click", () => {
    for (const button of Object.values(saveButtons)) button.disabled = true;
    news.textContent = "Writing the PNG.";
    send({ kind: "save", bits });
  });
}
zoom.addEventListener("click", () => {
  const fit = stage.classList.toggle("fit");
  zoom.textContent = fit ? "Show at 100 %" : "Fit into the page";
  zoom.setAttribute("aria-pressed", String(!fit));
  place();
});
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
