/** What the page and its worker say to each other. */
import type { Triple } from "../core/capture.js";

/** What the page shows of a camera. */
export interface CameraFacts {
  name: string;
  version: string;
  sizes: string[];
  sensor: [number, number];
}

/** What the page shows of a photograph; a value that its file does not state is absent. */
export interface PhotoFacts {
  name: string;
  width: number;
  height: number;
  camera: string;
  bundle?: string;
  iso?: number;
  whiteBalance?: Triple;
  origin?: [number, number];
  notes: string[];
}

/** What a person may set. */
export interface Settings {
  size: string;
  iso: number;
  whiteBalance: Triple;
  origin: [number, number];
}

export interface Pixels {
  /** Red, green, blue and opacity of each pixel. */
  rgba: Uint8ClampedArray<ArrayBuffer>;
  width: number;
  height: number;
}

export type Order =
  | { kind: "start"; wasm: ArrayBuffer; glue: string; threads: number }
  | { kind: "files"; files: { name: string; bytes: ArrayBuffer }[] }
  | { kind: "develop"; settings: Settings }
  | { kind: "show"; stops: number }
  | { kind: "save"; bits: 8 | 16; stops: number }
  | { kind: "light" };

export type Answer =
  | { kind: "ready"; threads: number }
  | { kind: "camera"; facts: CameraFacts; files: string[] }
  | { kind: "photo"; facts: PhotoFacts }
  | { kind: "progress"; step: string; share: number }
  | { kind: "done"; seconds: number }
  | { kind: "shown"; before: Pixels; after: Pixels }
  | { kind: "saved"; png: ArrayBuffer; bits: 8 | 16 }
  | { kind: "light"; light: Float32Array; width: number; height: number }
  | { kind: "error"; message: string };
