/** Members of a zip, stored or deflated (APPNOTE 6.3, sections 4.3.7 to 4.3.16). */
import { check } from "./error.js";
import { crc32, through } from "./png.js";

const MOST_BYTES = 512 << 20;
const DAMAGED = "The zip is damaged. Copy it again.";

export function isZip(bytes: Uint8Array): boolean {
  return bytes[0] === 0x50 && bytes[1] === 0x4b && bytes[2] === 3 && bytes[3] === 4;
}

/** Read the files of a zip; folders are cut off their names. */
export async function readZip(bytes: Uint8Array): Promise<Map<string, Uint8Array>> {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end--;
  check(end >= 0, DAMAGED);
  const members = new Map<string, Uint8Array>();
  let at = view.getUint32(end + 16, true);
  let total = 0;
  for (let i = view.getUint16(end + 10, true); i > 0; i--) {
    check(at + 46 <= end && view.getUint32(at, true) === 0x02014b50, DAMAGED);
    const [flags, method, crc, packed, size] = [view.getUint16(at + 8, true), view.getUint16(at + 10, true), view.getUint32(at + 16, true), view.getUint32(at + 20, true), view.getUint32(at + 24, true)];
    const [name, extra, comment] = [28, 30, 32].map((n) => view.getUint16(at + n, true)) as [number, number, number];
    const local = view.getUint32(at + 42, true);
    const path = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name));
    at += 46 + name + extra + comment;
    if (path.endsWith("/")) continue;
    check(!(flags & 1) && (method === 0 || method === 8), `The member ${path} of the zip is encrypted or packed in a way that is not read. Make the zip anew.`);
    check((total += size) <= MOST_BYTES && local + 30 <= bytes.length, DAMAGED);
    const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    const body = bytes.subarray(start, start + packed);
    const content = method === 0 ? body : await through(body, new DecompressionStream("deflate-raw"), size).catch(() => undefined);
    check(content?.length === size && crc32(content) === crc, DAMAGED);
    members.set(path.slice(path.lastIndexOf("/") + 1), content);
  }
  return members;
}
