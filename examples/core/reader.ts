/**
 * The chain of a portable camera around its graphs, as docs/guides/portable.md states it:
 *
 *   mosaic -> blocks (spans, place, block) -> planes -> tiles (kept, tile_S) -> even light
 *          -> places, warp -> picture
 */
import type { Tensor } from "onnxruntime-common";
import type { Camera, Values } from "./camera.js";
import type { Capture } from "./capture.js";
import { check } from "./error.js";

export interface Developed {
  /** Three planes of linear Rec.709: the picture, and the capture without the restoration. */
  light: Float32Array;
  before: Float32Array;
  width: number;
  height: number;
  orientation: number;
}

export interface Choices {
  /** Size of the network. */
  size: string;
  /** Called with what is done and the share of all work; what it throws ends the work. */
  progress?: (step: string, share: number) => void;
}

/** Share of the time that each step takes, for the progress alone. */
const SHARES = { blocks: 0.6, tiles: 0.3, warp: 0.1 };

/** Blocks along an axis, as the graph `spans` lays them. */
interface Spans {
  count: number;
  first: number[];
  turn: number[];
  index: number[];
  phase: number[];
  place: Float32Array;
  window: Tensor[];
}

/** Develop a capture that states its ISO and white balance. */
export async function develop(camera: Camera, capture: Capture, choices: Choices): Promise<Developed> {
  const { sensor, networks } = camera.about;
  const { width, height, samples, whiteBalance: gains, iso } = capture;
  check(networks[choices.size], `The camera has no network of size ${choices.size}, only ${Object.keys(networks).join(", ")}.`);
  check(gains && gains.every((gain) => gain > 0 && Number.isFinite(gain)), "The gains of red and blue are numbers above 0.");
  check(capture.noise || (iso && iso > 0 && Number.isFinite(iso)), "The ISO is a number above 0.");
  const white = capture.white ?? sensor.white_level;
  const blacks = capture.black ?? Array<number>(4).fill(sensor.black_level);
  const black = blacks[0]!;
  check(Math.max(...blacks) < white, `Black (${Math.max(...blacks)}) must lie below white (${white}).`);
  const even = blacks.every((n) => n === black);
  const limit = black + sensor.clip_share * (white - black);
  const clip = even ? Math.ceil(limit) : limit; // of other blacks no whole numbers are left
  const origin = capture.origin ?? [0, 1].map((i) => 2 * Math.floor((sensor.size_px[i]! - [width, height][i]!) / 4));
  const axis = sensor.axis_px.map((at, i) => at - origin[i]!) as [number, number];
  const stated = capture.noise && { shot: camera.tensor(capture.noise.shot), read_variance: camera.tensor(capture.noise.readVariance) };
  const noise = stated ?? (await camera.run("noise", { iso: camera.exact(iso!) }));
  const known: Values = { ...noise, levels: camera.tensor([black, white, clip]), gains: camera.tensor(gains) };
  const mosaic = Float32Array.from(samples);
  if (!even) {
    for (let i = 0; i < mosaic.length; i++) {
      const own = blacks[2 * (Math.floor(i / width) & 1) + ((i % width) & 1)]!;
      mosaic[i] = black + ((mosaic[i]! - own) * (white - black)) / (white - own);
    }
  }
  const progress = choices.progress ?? (() => undefined);
  const planes = await restore(camera, { mosaic, width, height, cfa: capture.cfa ?? patternAt(sensor.cfa, origin), clip, axis }, known, progress);
  const clipped = mosaic.map((sample) => (sample >= clip ? 1 : 0));
  const { out: kept } = await camera.run("kept", { clipped: camera.tensor(clipped, [1, 1, height, width]) });
  const cleaned = await clean(camera, choices.size, { planes, kept: kept!.data as Float32Array, width, height, axis }, known, progress);
  return { ...(await straighten(camera, cleaned, planes, { width, height, axis }, progress)), width, height, orientation: capture.orientation };
}

/** Letters of the cell at a place of the sensor, whose own first cell is given. */
function patternAt(cfa: string, [x, y]: number[]): string {
  return [0, 1, 2, 3].map((i) => cfa[2 * (((i >> 1) + y!) & 1) + ((i + x!) & 1)]).join("");
}

async function laySpans(camera: Camera, size: number, axis: number, red: number): Promise<Spans> {
  const made = await camera.run("spans", { size_px: camera.whole(size), axis_px: camera.exact(axis), red: camera.whole(red) });
  const whole = (name: string) => Array.from(made[name]!.data as BigInt64Array, Number);
  const window = made.window!.data as Float32Array;
  const [count, block] = made.window!.dims as [number, number];
  return {
    count,
    first: whole("first_px"),
    turn: whole("turn"),
    index: whole("index"),
    phase: whole("phase"),
    place: made.place_mm!.data as Float32Array,
    window: Array.from({ length: count }, (_, i) => camera.tensor(window.slice(i * block, (i + 1) * block))),
  };
}

interface Mosaic {
  mosaic: Float32Array;
  width: number;
  height: number;
  cfa: string;
  clip: number;
  axis: [number, number];
}

/** Demosaicked and restored planes, six of them: blocks by place, in the order in which places come up. */
async function restore(camera: Camera, capture: Mosaic, known: Values, progress: NonNullable<Choices["progress"]>): Promise<Float32Array> {
  const { bank } = camera.about;
  const { mosaic, width, height, cfa, clip, axis } = capture;
  const red = cfa.indexOf("R");
  const down = await laySpans(camera, height, axis[1], red >> 1);
  const across = await laySpans(camera, width, axis[0], red & 1);
  if (camera.about.haze) {
    // it is found in coarse cells of the whole capture
    const whole = { ...known, mosaic: camera.tensor(mosaic, [height, width]), red_px: camera.whole(red & 1, red >> 1) };
    known = { ...known, ...(await camera.run("haze", { ...(await camera.run("cells", whole)), axis_px: camera.exact(...axis) })) };
  }
  const places = new Map<string, [number, number][]>();
  for (let i = 0; i < down.count; i++) {
    for (let j = 0; j < across.count; j++) {
      const key = `${across.place[j]} ${down.place[i]}`;
      places.set(key, [...(places.get(key) ?? []), [i, j]]);
    }
  }
  const total = new Float32Array(6 * width * height);
  const margin = bank.margin_px;
  const side = bank.block_px + 2 * margin;
  const samples = new Float32Array(side * side);
  let done = 0;
  for (const blocks of places.values()) {
    const [row, column] = blocks[0]!;
    const place = [across.place[column]!, down.place[row]!];
    const kind = bank.mosaic_within_mm !== null && Math.hypot(...place) <= bank.mosaic_within_mm ? "_mosaic" : "";
    const here = { ...known, ...(await camera.run(`place${kind}`, { place_mm: camera.tensor(place) })) };
    for (const [i, j] of blocks) {
      progress("Restoring blocks", (SHARES.blocks * done++) / (down.count * across.count));
      let lit = false;
      for (let y = 0, at = 0; y < side; y++) {
        const start = down.index[i * side + y]! * width;
        for (let x = 0; x < side; x++, at++) {
          const sample = mosaic[start + across.index[j * side + x]!]!;
          samples[at] = sample;
          lit ||= sample >= clip && y >= margin && x >= margin && y < side - margin && x < side - margin;
        }
      }
      const { out } = await camera.run(`block${kind}${bank.lights && lit ? "_lights" : ""}`, {
        ...here,
        mosaic: camera.tensor(samples, [side, side]),
        phase: camera.whole(2 * down.phase[i]! + across.phase[j]!),
        window_y: down.window[i]!,
        window_x: across.window[j]!,
        row_index: camera.whole(...down.index.slice(i * side, (i + 1) * side)),
        column_index: camera.whole(...across.index.slice(j * side, (j + 1) * side)),
      });
      const from = { top: down.first[i]!, left: across.first[j]!, turnY: down.turn[i]! < 0, turnX: across.turn[j]! < 0 };
      add(total, width, height, out!.data as Float32Array, bank.block_px, from);
    }
  }
  return total;
}

/** Add a block to the planes, read backwards where it was turned. */
function add(total: Float32Array, width: number, height: number, out: Float32Array, block: number, from: { top: number; left: number; turnY: boolean; turnX: boolean }): void {
  const { top, left, turnY, turnX } = from;
  const [y0, y1] = [Math.max(top, 0), Math.min(top + block, height)];
  const [x0, x1] = [Math.max(left, 0), Math.min(left + block, width)];
  for (let plane = 0; plane < 6; plane++) {
    for (let y = y0; y < y1; y++) {
      const row = (plane * block + (turnY ? block - 1 - (y - top) : y - top)) * block;
      const to = (plane * height + y) * width;
      if (turnX) for (let x = x0; x < x1; x++) total[to + x]! += out[row + block - 1 - (x - left)]!;
      else for (let x = x0; x < x1; x++) total[to + x]! += out[row + x - left]!;
    }
  }
}

/** Side of tiles along an axis: the least of as many as tiles of some side would need. */
function sideOf(size: number, most: number, halo: number, stride: number): number {
  const count = Math.max(1, Math.ceil((size - 2 * halo) / (most - 2 * halo)));
  return Math.ceil((size + (count - 1) * 2 * halo) / (count * stride)) * stride;
}

/** Tiles along an axis: first pixel, and first and last of those that are kept. */
function tiles(size: number, side: number, halo: number): [number, number, number][] {
  const count = side >= size ? 1 : Math.ceil((size - 2 * halo) / (side - 2 * halo));
  const firsts = Array.from({ length: count }, (_, i) => Math.min(i * (side - 2 * halo), size - side));
  return firsts.map((first, i) => [first, i ? first + halo : 0, i + 1 < count ? firsts[i + 1]! + halo : size]);
}

interface Restored {
  planes: Float32Array;
  /** Share of what the network adds that counts, less beside clipped samples. */
  kept: Float32Array;
  width: number;
  height: number;
  axis: [number, number];
}

/** Three planes of light of the camera's colours, clean and even. */
async function clean(camera: Camera, size: string, restored: Restored, known: Values, progress: NonNullable<Choices["progress"]>): Promise<Float32Array> {
  const { graph, halo_px: halo, stride_px: stride, tile_px: most } = camera.about.networks[size]!;
  const { sensor } = camera.about;
  const { planes, kept, width, height, axis } = restored;
  const [wide, high] = [width, height].map((n) => Math.ceil(n / stride) * stride) as [number, number];
  const [broad, tall] = [wide, high].map((n) => sideOf(n, most, halo, stride)) as [number, number];
  const even = new Float32Array(3 * width * height);
  /** A tile of some planes, whose border repeats. */
  const cut = (from: Float32Array, count: number, x: number, y: number) => {
    const out = new Float32Array(count * tall * broad);
    for (let i = 0; i < count * tall; i++) {
      const row = (Math.floor(i / tall) * height + Math.min(y + (i % tall), height - 1)) * width;
      const inside = Math.min(broad, width - x);
      out.set(from.subarray(row + x, row + x + inside), i * broad);
      out.fill(from[row + width - 1]!, i * broad + inside, (i + 1) * broad);
    }
    return camera.tensor(out, [1, count, tall, broad]);
  };
  const across = tiles(wide, broad, halo);
  const down = tiles(high, tall, halo);
  let done = 0;
  for (const [y, top, bottom] of down) {
    for (const [x, left, right] of across) {
      progress("Removing noise", SHARES.blocks + (SHARES.tiles * done++) / (across.length * down.length));
      const origin = camera.tensor([(x - axis[0]) * sensor.pitch_mm, (y - axis[1]) * sensor.pitch_mm]);
      const { out } = await camera.run(graph, { ...known, planes: cut(planes, 6, x, y), kept: cut(kept, 1, x, y), origin_mm: origin });
      const light = out!.data as Float32Array;
      for (let plane = 0; plane < 3; plane++) {
        for (let row = top; row < Math.min(bottom, height); row++) {
          const from = (plane * tall + row - y) * broad - x;
          even.set(light.subarray(from + left, from + Math.min(right, width)), (plane * height + row) * width + left);
        }
      }
    }
  }
  return even;
}

interface Frame {
  width: number;
  height: number;
  axis: [number, number];
}

/** The picture in linear Rec.709 without distortion; the same of the demosaicked planes, to compare. */
async function straighten(camera: Camera, even: Float32Array, planes: Float32Array, frame: Frame, progress: NonNullable<Choices["progress"]>): Promise<Pick<Developed, "light" | "before">> {
  const { width, height, axis } = frame;
  const side = camera.about.warp_px;
  const light = new Float32Array(3 * width * height);
  const before = new Float32Array(3 * width * height);
  const [across, down] = [Math.ceil(width / side), Math.ceil(height / side)];
  let matrix: number[] | undefined;
  for (let tile = 0; tile < across * down; tile++) {
    progress("Straightening", 1 - SHARES.warp * (1 - tile / (across * down)));
    const [x, y] = [(tile % across) * side, Math.floor(tile / across) * side];
    const [right, bottom] = [Math.min(x + side, width), Math.min(y + side, height)];
    const places = await camera.run("places", {
      target_px: camera.exact(x, y),
      axis_px: camera.exact(...axis),
      middle_px: camera.exact((width - 1) / 2, (height - 1) / 2),
    });
    const at = places.places!;
    const [x0, x1] = sourceSpan(places, 0, x, width);
    const [y0, y1] = sourceSpan(places, 1, y, height);
    const part = new Float32Array(3 * (y1 - y0) * (x1 - x0));
    for (let row = 0, to = 0; row < 3 * (y1 - y0); row++, to += x1 - x0) {
      const start = (Math.floor(row / (y1 - y0)) * height + y0 + (row % (y1 - y0))) * width;
      part.set(even.subarray(start + x0, start + x1), to);
    }
    const values = { planes: camera.tensor(part, [1, 3, y1 - y0, x1 - x0]), places: at, first_px: camera.tensor([x0 - x, y0 - y]) };
    // where there are no lamps and nothing falls far below black, nothing is to be limited
    const plain = part.every((sample) => sample <= camera.about.warp_white) ? await camera.run("warp", values) : undefined;
    const isEnough = plain && (plain.least!.data as Float32Array)[0]! >= camera.about.warp_floor;
    const made = (isEnough ? plain : await camera.run("warp_limited", values)).out!.data as Float32Array;
    for (let plane = 0; plane < 3; plane++) {
      for (let row = y; row < bottom; row++) {
        const from = (plane * side + row - y) * side;
        light.set(made.subarray(from, from + right - x), (plane * height + row) * width + x);
      }
    }
    matrix ??= await colourMatrix(camera, at.dims);
    sample(before, planes, matrix, at.data as Float32Array, side, [x, y, right, bottom], frame);
  }
  return { light, before };
}

/** The matrix from the camera's colours to linear Rec.709: what the warp makes of each colour alone. */
async function colourMatrix(camera: Camera, shape: readonly number[]): Promise<number[]> {
  const places = new Float32Array(shape.reduce((product, n) => product * n, 1));
  const map = places.length / shape[0]!;
  for (let i = 0; i < 3 * shape[0]!; i++) places[Math.floor(i / 3) * map + 2 * (i % 3)] = i % 3;
  const colours = camera.tensor([0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5], [1, 3, 1, 3]);
  const { out } = await camera.run("warp", { planes: colours, places: camera.tensor(places, [...shape]), first_px: camera.tensor([0, 0]) });
  return Array.from({ length: 9 }, (_, i) => 2 * (out!.data as Float32Array)[Math.floor(i / 3) * camera.about.warp_px ** 2 + (i % 3)]!);
}

/** Sample demosaicked planes, at most white, at the places of a tile: linear between pixels. */
function sample(out: Float32Array, planes: Float32Array, matrix: number[], places: Float32Array, side: number, [x, y, right, bottom]: [number, number, number, number], { width, height }: Frame): void {
  const map = places.length === 2 * side * side ? 0 : 2 * side * side;
  const light = [0, 0, 0];
  for (let row = y; row < bottom; row++) {
    for (let column = x; column < right; column++) {
      for (let c = 0; c < 3; c++) {
        const i = c * map + 2 * ((row - y) * side + column - x);
        const u = Math.min(Math.max(places[i]! + x, 0), width - 1);
        const v = Math.min(Math.max(places[i + 1]! + y, 0), height - 1);
        const [left, top] = [Math.floor(u), Math.floor(v)];
        const from = (c * height + top) * width + left;
        const next = left + 1 < width ? 1 : 0;
        const below = top + 1 < height ? width : 0;
        const upper = planes[from]! + (u - left) * (planes[from + next]! - planes[from]!);
        const lower = planes[from + below]! + (u - left) * (planes[from + below + next]! - planes[from + below]!);
        light[c] = Math.min(upper + (v - top) * (lower - upper), 1);
      }
      const [red, green, blue] = light as [number, number, number];
      for (let c = 0; c < 3; c++) out[(c * height + row) * width + column] = matrix[3 * c]! * red + matrix[3 * c + 1]! * green + matrix[3 * c + 2]! * blue;
    }
  }
}

/** First pixel of the capture that the places of a tile need along x (0) or y (1), and the one behind the last. */
function sourceSpan(places: Values, i: 0 | 1, target: number, size: number): [number, number] {
  const [least, most] = [places.least!, places.most!].map(({ data }) => (data as Float32Array)[i]!) as [number, number];
  const first = Math.min(Math.max(Math.floor(least) - 1 + target, 0), size - 1);
  return [first, Math.max(Math.min(Math.ceil(most) + 3 + target, size), first + 1)];
}
