/**
 * A DNG as a capture: Bayer mosaics of 8 to 16 bits, uncompressed or lossless JPEG.
 * Anything else is refused by its name. Tags: DNG specification 1.7.1, chapters 3 and 4.
 */
import type { Capture, Triple } from "./capture.js";
import { check } from "./error.js";
import { decodeLosslessJpeg } from "./lossless_jpeg.js";
import { type Directory, readTiff, type Tiff } from "./tiff.js";

const PATTERNS = ["RGGB", "GRBG", "GBRG", "BGGR"];
const CFA = 32803;
const LINEAR = 34892;
const METHODS: Record<number, string> = {
  5: "LZW", 6: "old JPEG", 8: "Deflate", 9: "VC-5", 32773: "PackBits", 32946: "Deflate",
  34712: "JPEG 2000", 34892: "lossy JPEG", 50002: "JPEG XL", 52546: "JPEG XL",
};
const SAVE = "Save it uncompressed or with lossless JPEG.";
const MOST_PIXELS = 200_000_000;

/** Read a DNG. */
export function readDng(bytes: Uint8Array): Capture {
  const tiff = readTiff(bytes);
  check(tiff.directories.some((d) => d.has(50706)), "The file is a TIFF, but no DNG. Drop a DNG, or a mosaic as PNG.");
  const picture = sensorPicture(tiff);
  checkReadable(picture);
  const width = picture.first(256, 0);
  const height = picture.first(257, 0);
  check(width >= 2 && height >= 2 && width * height <= Math.min(MOST_PIXELS, 256 * bytes.length), `The header claims ${width}x${height} pixels, which cannot be. The file is damaged.`);
  const whole = readSamples(bytes, tiff, picture, width, height);
  const table = picture.numbers(50712); // LinearizationTable
  if (table.length) for (let i = 0; i < whole.length; i++) whole[i] = table[Math.min(whole[i]!, table.length - 1)]!;
  const [top, left, bottom, right] = activeArea(picture, width, height);
  const samples = new Uint16Array((bottom - top) * (right - left));
  for (let y = top; y < bottom; y++) samples.set(whole.subarray(y * width + left, y * width + right), (y - top) * (right - left));
  return { samples, width: right - left, height: bottom - top, ...facts(tiff, picture) };
}

/** The full-size picture, else the largest of those that hold light of the sensor. */
function sensorPicture(tiff: Tiff): Directory {
  const size = (d: Directory) => (d.first(254, 0) === 0 ? 1e12 : 0) + d.first(256, 0) * d.first(257, 0);
  const [picture] = tiff.directories.filter((d) => [CFA, LINEAR].includes(d.first(262, 0)) && d.has(256)).sort((a, b) => size(b) - size(a));
  check(picture, "The DNG holds no picture of a sensor. The file is damaged.");
  return picture;
}

function checkReadable(picture: Directory): void {
  const method = picture.first(259, 1);
  check(picture.first(339, 1) !== 3, "The DNG holds floating-point samples, which are not read. Drop the camera's own file.");
  check(picture.first(262, 0) !== LINEAR, `The DNG is linear: it was demosaicked already${method === 34892 ? " and compressed with lossy JPEG" : ""}. Drop the camera's own file.`);
  check(method === 1 || method === 7, `The DNG is compressed with ${METHODS[method] ?? `method ${method}`}, which is not read. ${SAVE}`);
  const bits = picture.first(258, 1);
  check(bits >= 8 && bits <= 16, `The DNG holds samples of ${bits} bits, which are not read.`);
  check(picture.first(277, 1) === 1, "The DNG holds several samples for each pixel, which is not read.");
  check(PATTERNS.includes(pattern(picture)), "The sensor of this photograph has no Bayer pattern of red, green and blue, which is not read.");
  check(picture.first(50711, 1) === 1, "The sensor has staggered rows or columns, which are not read.");
  for (const tag of [50974, 50975, 52547]) check(picture.first(tag, 1) <= 1, `The DNG interleaves its rows or columns, which is not read. ${SAVE}`);
  for (const tag of [50715, 50716]) check(picture.numbers(tag).every((n) => n === 0), "The DNG states a black level for each row or column, which is not read.");
}

function pattern(picture: Directory): string {
  const [rows, columns] = picture.numbers(33421);
  const planes = picture.numbers(50710);
  if (rows !== 2 || columns !== 2 || (planes.length && planes.join() !== "0,1,2")) return "";
  return picture.numbers(33422).map((n) => "RGB"[n] ?? "?").join("");
}

function activeArea(picture: Directory, width: number, height: number): [number, number, number, number] {
  const [top, left, bottom, right] = picture.numbers(50829);
  const believed = top! >= 0 && left! >= 0 && top! + 2 <= bottom! && left! + 2 <= right! && bottom! <= height && right! <= width;
  return believed ? [top!, left!, bottom!, right!] : [0, 0, height, width];
}

function readSamples(bytes: Uint8Array, tiff: Tiff, picture: Directory, width: number, height: number): Uint16Array {
  const tiled = picture.has(324);
  const offsets = picture.numbers(tiled ? 324 : 273);
  const counts = picture.numbers(tiled ? 325 : 279);
  const wide = tiled ? picture.first(322, 0) : width;
  const tall = tiled ? picture.first(323, 0) : Math.min(picture.first(278, height), height);
  const across = Math.ceil(width / wide);
  check(wide >= 1 && tall >= 1 && offsets.length === counts.length && offsets.length === across * Math.ceil(height / tall), "The header of the DNG contradicts itself. The file is damaged.");
  const out = new Uint16Array(width * height);
  const bits = picture.first(258, 16);
  offsets.forEach((offset, i) => {
    check(offset + counts[i]! <= bytes.length, "The file is cut off: its samples reach beyond its end. Copy it again.");
    const chunk = bytes.subarray(offset, offset + counts[i]!);
    const y = Math.floor(i / across) * tall;
    const x = (i % across) * wide;
    const rows = tiled ? tall : Math.min(tall, height - y);
    const part = picture.first(259, 1) === 7 ? decodeLosslessJpeg(chunk, wide * tall).samples : unpack(chunk, bits, wide, rows, tiff.little);
    const kept = Math.min(wide, width - x);
    check(part.length >= (Math.min(rows, height - y) - 1) * wide + kept, "A strip or tile of the DNG holds fewer samples than it should. The file is damaged.");
    for (let r = 0; r < Math.min(rows, height - y); r++) out.set(part.subarray(r * wide, r * wide + kept), (y + r) * width + x);
  });
  return out;
}

/** Uncompressed samples: of 16 bits in the order of the file, of others packed, highest bit first. */
function unpack(bytes: Uint8Array, bits: number, wide: number, rows: number, little: boolean): Uint16Array {
  const stride = Math.ceil((wide * bits) / 8);
  check(bytes.length >= stride * rows, "A strip or tile of the DNG holds fewer samples than it should. The file is damaged.");
  const out = new Uint16Array(wide * rows);
  const [low, high] = little ? [0, 1] : [1, 0];
  for (let y = 0, i = 0; y < rows; y++) {
    let at = y * stride;
    if (bits === 16) {
      for (let x = 0; x < wide; x++, at += 2) out[i++] = bytes[at + low]! | (bytes[at + high]! << 8);
      continue;
    }
    for (let x = 0, held = 0, count = 0; x < wide; x++) {
      for (; count < bits; count += 8) held = ((held << 8) | bytes[at++]!) & 0xffffff;
      count -= bits;
      out[i++] = (held >> count) & ((1 << bits) - 1);
    }
  }
  return out;
}

function facts(tiff: Tiff, picture: Directory): Omit<Capture, "samples" | "width" | "height"> {
  const all = [picture, ...tiff.directories];
  const numbers = (tag: number) => all.find((d) => d.numbers(tag).length)?.numbers(tag) ?? [];
  const text = (tag: number) => all.map((d) => d.text(tag)).find(Boolean) ?? "";
  const notes = [51008, 51009].filter((tag) => picture.has(tag)).map((tag) => `The corrections in OpcodeList${tag - 51007} are not applied.`);
  const neutral = numbers(50728);
  const iso = numbers(34855)[0] ?? 0;
  const orientation = numbers(274)[0] ?? 1;
  const camera = text(50708) || `${text(271)} ${text(272)}`.trim();
  const sensor = place(text(270));
  const noise = noiseProfile(numbers(51041), pattern(picture));
  const bundle = sensor.bundle ?? /^camkit ([\w.-]{1,64})$/.exec(camera)?.[1];
  return {
    cfa: pattern(picture),
    black: blackLevel(picture),
    white: picture.first(50717, 2 ** picture.first(258, 16) - 1),
    orientation: orientation >= 1 && orientation <= 8 ? orientation : 1,
    camera,
    notes,
    ...(neutral.length === 3 && neutral.every((n) => n > 0 && Number.isFinite(n)) && { whiteBalance: gains(neutral as Triple) }),
    ...(iso > 0 && iso < 65535 && { iso }),
    ...(sensor.origin && { origin: sensor.origin }),
    ...(noise && { noise }),
    ...(bundle && { bundle }),
  };
}

function gains(neutral: Triple): Triple {
  const inverse = neutral.map((n) => 1 / n);
  return [inverse[0]! / inverse[1]!, 1, inverse[2]! / inverse[1]!];
}

/** Black of the four positions of the cell. */
function blackLevel(picture: Directory): number[] {
  const levels = picture.numbers(50714);
  if (!levels.length) return [0, 0, 0, 0];
  const [rows = 1, columns = 1] = picture.numbers(50713);
  check(levels.every((n) => Number.isFinite(n) && n >= 0), "The black level of the DNG cannot be. The file is damaged.");
  if (levels.every((n) => n === levels[0])) return Array<number>(4).fill(levels[0]!);
  check(rows <= 2 && columns <= 2 && levels.length === rows * columns, "The DNG states black for more than 2x2 pixels, which is not read.");
  return [0, 1, 2, 3].map((i) => levels[((i >> 1) % rows) * columns + ((i & 1) % columns)]!);
}

/** Scale and offset of each colour, or of each position of the cell. */
function noiseProfile(values: number[], cfa: string): Capture["noise"] {
  if (!values.length || values.some((n) => !Number.isFinite(n) || n < 0)) return undefined;
  const pair = (colour: string, of: 0 | 1): number => {
    if (values.length === 8) {
      const of4 = [0, 1, 2, 3].filter((i) => cfa[i] === colour).map((i) => values[2 * i + of]!);
      return of4.reduce((sum, n) => sum + n, 0) / of4.length;
    }
    return values[values.length === 6 ? 2 * "RGB".indexOf(colour) + of : of]!;
  };
  if (![2, 6, 8].includes(values.length)) return undefined;
  return { shot: [pair("R", 0), pair("G", 0), pair("B", 0)], readVariance: [pair("R", 1), pair("G", 1), pair("B", 1)] };
}

/** Where on which sensor a capture lies, as camkit writes it into ImageDescription. */
function place(description: string): { bundle?: string; origin?: [number, number] } {
  try {
    const { bundle, origin_px: origin } = JSON.parse(description).camkit;
    const whole = Array.isArray(origin) && origin.length === 2 && origin.every((n) => Number.isInteger(n) && n >= 0);
    return { ...(typeof bundle === "string" && { bundle }), ...(whole && { origin: origin as [number, number] }) };
  } catch {
    return {};
  }
}
