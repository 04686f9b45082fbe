/** Lossless JPEG (ITU-T T.81, annex H): one scan, Huffman codes, predictors 1 to 7. */
import { check } from "./error.js";

const DAMAGED = "The photograph is damaged: its compressed samples cannot be read. Copy the file again.";
const LOSSY = [0xc0, 0xc1, 0xc2];

/** For every 16 bits that may come next: the length of the code, and what it stands for. */
class HuffmanTable {
  readonly length = new Uint8Array(1 << 16);
  readonly value = new Uint8Array(1 << 16);

  constructor(counts: Uint8Array, values: Uint8Array) {
    let at = 0;
    let next = 0;
    for (let bits = 1; bits <= 16; bits++) {
      for (let i = 0; i < counts[bits - 1]!; i++, next++) {
        const end = at + (1 << (16 - bits));
        check(end <= 1 << 16 && next < values.length, DAMAGED);
        this.length.fill(bits, at, end);
        this.value.fill(values[next]!, at, end);
        at = end;
      }
    }
  }
}

class Bits {
  private held = 0;
  private count = 0;
  private past = 0;

  constructor(
    private readonly bytes: Uint8Array,
    public at: number,
  ) {}

  /** Hold at least 16 bits; zeros stand behind the end of the scan, a few of them. */
  private fill(): void {
    while (this.count <= 16) {
      let byte = this.bytes[this.at];
      if (byte === undefined || (byte === 0xff && this.bytes[this.at + 1] !== 0)) {
        check(++this.past <= 4, DAMAGED);
        byte = 0;
      } else {
        this.at += byte === 0xff ? 2 : 1;
      }
      this.held = ((this.held << 8) | byte) >>> 0;
      this.count += 8;
    }
  }

  difference(table: HuffmanTable): number {
    if (this.count < 16) this.fill();
    const next = (this.held >>> (this.count - 16)) & 0xffff;
    const length = table.length[next]!;
    check(length, DAMAGED);
    this.count -= length;
    const size = table.value[next]!;
    if (size === 0) return 0;
    if (size === 16) return 32768;
    check(size < 16, DAMAGED);
    if (this.count < 16) this.fill();
    this.count -= size;
    const value = (this.held >>> this.count) & ((1 << size) - 1);
    return value < 1 << (size - 1) ? value - (1 << size) + 1 : value;
  }

  /** Go on behind the restart marker that comes next. */
  restart(): void {
    this.held = this.count = this.past = 0;
    while (this.at + 1 < this.bytes.length && !(this.bytes[this.at] === 0xff && this.bytes[this.at + 1]! >> 3 === 0x1a)) this.at++;
    this.at += 2;
  }
}

export interface JpegFrame {
  width: number;
  height: number;
  components: number;
  /** Components of a pixel side by side, rows one after the other. */
  samples: Uint16Array;
}

/** Decode a lossless JPEG that has so many samples, not more. */
export function decodeLosslessJpeg(bytes: Uint8Array, most: number): JpegFrame {
  check(bytes[0] === 0xff && bytes[1] === 0xd8, DAMAGED);
  const tables = new Map<number, HuffmanTable>();
  let frame: { precision: number; height: number; width: number; ids: number[] } | undefined;
  let interval = 0;
  for (let at = 2; at + 4 <= bytes.length; ) {
    check(bytes[at] === 0xff, DAMAGED);
    const marker = bytes[at + 1]!;
    const length = (bytes[at + 2]! << 8) | bytes[at + 3]!;
    const body = bytes.subarray(at + 4, at + 2 + length);
    check(length >= 2 && body.length === length - 2, DAMAGED);
    at += 2 + length;
    check(!LOSSY.includes(marker), "The photograph is compressed with lossy JPEG, which is not read. Save it uncompressed or with lossless JPEG.");
    if (marker === 0xc4) {
      for (let i = 0; i + 17 <= body.length; ) {
        const counts = body.subarray(i + 1, i + 17);
        const end = i + 17 + counts.reduce((sum, n) => sum + n, 0);
        tables.set(body[i]! & 15, new HuffmanTable(counts, body.subarray(i + 17, end)));
        i = end;
      }
    } else if (marker === 0xc3) {
      check(body.length >= 6 + 3 * body[5]!, DAMAGED);
      frame = {
        precision: body[0]!,
        height: (body[1]! << 8) | body[2]!,
        width: (body[3]! << 8) | body[4]!,
        ids: Array.from({ length: body[5]! }, (_, i) => body[6 + 3 * i]!),
      };
    } else if (marker === 0xdd) {
      interval = (body[0]! << 8) | body[1]!;
    } else if (marker === 0xda) {
      check(frame && body[0] === frame.ids.length && body.length >= 4 + 2 * body[0], DAMAGED);
      check(frame.width * frame.height * frame.ids.length <= most, DAMAGED);
      const used = frame.ids.map((_, i) => tables.get(body[2 + 2 * i]! >> 4));
      const last = 1 + 2 * frame.ids.length;
      return decodeScan(new Bits(bytes, at), frame, used, { predictor: body[last]!, shift: body[last + 2]! & 15, interval });
    }
  }
  check(false, DAMAGED);
}

function decodeScan(
  bits: Bits,
  frame: { precision: number; height: number; width: number; ids: number[] },
  used: (HuffmanTable | undefined)[],
  scan: { predictor: number; shift: number; interval: number },
): JpegFrame {
  const { width, height, precision } = frame;
  const components = frame.ids.length;
  const { predictor, shift, interval } = scan;
  check(width && height && components >= 1 && components <= 4 && precision <= 16 && predictor >= 1 && predictor <= 7, DAMAGED);
  const tables = used.map((table) => {
    check(table, DAMAGED);
    return table;
  });
  const row = width * components;
  const samples = new Uint16Array(row * height);
  let left = interval;
  let fresh = true; // at the start, and behind a restart, nothing lies above
  for (let y = 0, at = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      if (interval && left-- === 0) {
        bits.restart();
        left = interval - 1;
        fresh = true;
      }
      for (let c = 0; c < components; c++, at++) {
        let guess: number;
        if (fresh && x === 0) guess = 1 << (precision - shift - 1);
        else if (fresh) guess = samples[at - components]!;
        else if (x === 0) guess = samples[at - row]!;
        else {
          const a = samples[at - components]!;
          const b = samples[at - row]!;
          const d = samples[at - row - components]!;
          switch (predictor) {
            case 1: guess = a; break;
            case 2: guess = b; break;
            case 3: guess = d; break;
            case 4: guess = a + b - d; break;
            case 5: guess = a + ((b - d) >> 1); break;
            case 6: guess = b + ((a - d) >> 1); break;
            default: guess = (a + b) >> 1;
          }
        }
        samples[at] = guess + bits.difference(tables[c]!);
      }
    }
    fresh = false;
  }
  if (shift) for (let i = 0; i < samples.length; i++) samples[i] = samples[i]! << shift;
  return { width, height, components, samples };
}
