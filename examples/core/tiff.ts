/** Directories of a TIFF or DNG: tags as numbers and text (TIFF 6.0, sections 2 and 8). */
import { check } from "./error.js";

const BYTES = [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4]; // of one value, by the type of a field
const MOST_DIRECTORIES = 64;
const SUB_DIRECTORIES = [330, 34665]; // SubIFDs, EXIF

interface Field {
  type: number;
  count: number;
  at: number;
}

/** One directory. A tag that is absent, or of another kind than asked for, gives nothing. */
export class Directory {
  constructor(
    private readonly view: DataView,
    private readonly little: boolean,
    private readonly fields: Map<number, Field>,
  ) {}

  has(tag: number): boolean {
    return this.fields.has(tag);
  }

  numbers(tag: number): number[] {
    const field = this.fields.get(tag);
    if (!field || field.type === 2) return [];
    const size = BYTES[field.type]!;
    return Array.from({ length: field.count }, (_, i) => this.number(field.type, field.at + i * size));
  }

  first(tag: number, usual: number): number {
    const value = this.numbers(tag)[0];
    return value !== undefined && Number.isFinite(value) ? value : usual;
  }

  text(tag: number): string {
    const field = this.fields.get(tag);
    if (field?.type !== 2) return "";
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + field.at, field.count);
    return new TextDecoder().decode(bytes).replace(/\0[^]*$/, "").trim();
  }

  private number(type: number, at: number): number {
    const { view, little } = this;
    switch (type) {
      case 3: return view.getUint16(at, little);
      case 4: case 13: return view.getUint32(at, little);
      case 5: return view.getUint32(at, little) / view.getUint32(at + 4, little);
      case 6: return view.getInt8(at);
      case 8: return view.getInt16(at, little);
      case 9: return view.getInt32(at, little);
      case 10: return view.getInt32(at, little) / view.getInt32(at + 4, little);
      case 11: return view.getFloat32(at, little);
      case 12: return view.getFloat64(at, little);
      default: return view.getUint8(at);
    }
  }
}

export interface Tiff {
  directories: Directory[];
  little: boolean;
}

/** Read all directories of a TIFF, those inside others too. */
export function readTiff(bytes: Uint8Array): Tiff {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  check(bytes.length >= 8, "The file is no TIFF or DNG: it is empty, or nearly.");
  const little = view.getUint16(0) === 0x4949;
  check(little || view.getUint16(0) === 0x4d4d, "The file is no TIFF or DNG.");
  const magic = view.getUint16(2, little);
  check(magic !== 43, "The file is a BigTIFF, which is not read. Save it as a DNG.");
  check(magic === 42, "The file is no TIFF or DNG.");
  const directories: Directory[] = [];
  const waiting = [view.getUint32(4, little)];
  const seen = new Set<number>([0]);
  while (waiting.length && directories.length < MOST_DIRECTORIES) {
    const at = waiting.shift()!;
    if (seen.has(at) || at + 2 > bytes.length) continue;
    seen.add(at);
    const count = view.getUint16(at, little);
    const end = at + 2 + 12 * count;
    if (end > bytes.length) continue;
    const fields = new Map<number, Field>();
    for (let i = at + 2; i < end; i += 12) {
      const type = view.getUint16(i + 2, little);
      const length = view.getUint32(i + 4, little);
      const size = (BYTES[type] ?? 0) * length;
      const place = size <= 4 ? i + 8 : view.getUint32(i + 8, little);
      if (size && place + size <= bytes.length) fields.set(view.getUint16(i, little), { type, count: length, at: place });
    }
    const directory = new Directory(view, little, fields);
    directories.push(directory);
    waiting.push(...SUB_DIRECTORIES.flatMap((tag) => directory.numbers(tag).slice(0, MOST_DIRECTORIES)));
    if (end + 4 <= bytes.length) waiting.push(view.getUint32(end, little));
  }
  return { directories, little };
}
