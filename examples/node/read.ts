/**
 * Say what photographs hold: one line of JSON for each, with the SHA-256 of the samples as 16-bit
 * little-endian numbers, or the reason why a file is refused.
 *
 *   node read.mjs PHOTO...
 */
import { createHash } from "node:crypto";
import { readFile } from "node:fs/promises";
import { readDng } from "../core/dng.js";
import { FileError } from "../core/error.js";
import { isPng, readMosaic } from "../core/png.js";

for (const path of process.argv.slice(2)) {
  try {
    const bytes = new Uint8Array(await readFile(path));
    const { samples, ...facts } = isPng(bytes) ? await readMosaic(bytes) : readDng(bytes);
    const sha256 = createHash("sha256").update(new Uint8Array(samples.buffer)).digest("hex");
    console.log(JSON.stringify({ path, ...facts, sha256 }));
  } catch (error) {
    if (!(error instanceof FileError)) throw error;
    console.log(JSON.stringify({ path, refused: error.message }));
  }
}
