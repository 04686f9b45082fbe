/** A portable camera: its facts, its tables, and its graphs as sessions of onnxruntime. */
import type { InferenceSession, InferenceSessionFactory, Tensor, TensorConstructor } from "onnxruntime-common";
import { check, FileError } from "./error.js";
import { readTensors } from "./tensors.js";

/** onnxruntime-node or onnxruntime-web: readers work with either. */
export interface Runtime {
  InferenceSession: InferenceSessionFactory;
  Tensor: TensorConstructor;
}

export type Values = Record<string, Tensor>;

/** What of portable.json the readers need; docs/guides/portable.md says what each number means. */
export interface About {
  portable_version: number;
  kind?: string;
  camera: { name: string; version: string };
  sensor: {
    size_px: [number, number];
    pitch_mm: number;
    axis_px: [number, number];
    cfa: string;
    black_level: number;
    white_level: number;
    clip_share: number;
  };
  bank: { block_px: number; margin_px: number; mosaic_within_mm: number | null; lights: boolean };
  haze?: { cell_px: number } | null;
  networks: Record<string, { graph: string; halo_px: number; stride_px: number; tile_px: number }>;
  warp_px: number;
  warp_white: number;
  warp_floor: number;
  tables: string;
  graphs: Record<string, { file: string; inputs: string[]; tables: string[]; outputs: string[] }>;
}

const VERSIONS = [1, 2];

export class Camera {
  private readonly sessions = new Map<string, InferenceSession>();
  private readonly tables: Values = {};

  private constructor(
    readonly about: About,
    private readonly files: Map<string, Uint8Array>,
    private readonly runtime: Runtime,
    private readonly options: InferenceSession.SessionOptions,
  ) {
    const tables = readTensors(files.get(about.tables)!);
    for (const [name, { type, shape, data }] of tables) {
      check(type === "F32", `The table ${name} of the camera is of a type that is not read. Export the camera again.`);
      this.tables[name] = new runtime.Tensor("float32", data, shape);
    }
  }

  /** Open the files that `camkit portable` wrote. */
  static open(files: Map<string, Uint8Array>, runtime: Runtime, options: InferenceSession.SessionOptions = {}): Camera {
    const document = files.get("portable.json");
    check(document, "There is no portable.json: drop the whole folder, or the zip, that camkit portable wrote.");
    const about = parse(document);
    check(VERSIONS.includes(about.portable_version), `The camera is of version ${about.portable_version} of the format; this program reads versions ${VERSIONS.join(" and ")}.`);
    check((about.kind ?? "bayer") === "bayer", `The camera is of the kind ${about.kind}; this program develops the mosaics of Bayer cameras.`);
    for (const name of [about.tables, ...Object.values(about.graphs).map(({ file }) => file)]) {
      check(files.has(name), `The camera lacks its file ${name}. Drop the whole folder, or the zip, that camkit portable wrote.`);
    }
    return new Camera(about, files, runtime, options);
  }

  /** A tensor of numbers. */
  tensor(numbers: ArrayLike<number>, shape: number[] = [numbers.length]): Tensor {
    return new this.runtime.Tensor("float32", numbers instanceof Float32Array ? numbers : Float32Array.from(numbers), shape);
  }

  /** A tensor of double precision. */
  exact(...numbers: number[]): Tensor {
    return new this.runtime.Tensor("float64", Float64Array.from(numbers), [numbers.length]);
  }

  /** A tensor of whole numbers. */
  whole(...numbers: number[]): Tensor {
    return new this.runtime.Tensor("int64", BigInt64Array.from(numbers, BigInt), [numbers.length]);
  }

  /** Run a graph with what it needs of some values; it is loaded when it is first used. */
  async run(name: string, values: Values): Promise<Values> {
    const graph = this.about.graphs[name];
    check(graph, `The camera has no graph ${name}. Export the camera again.`);
    let session = this.sessions.get(name);
    if (!session) this.sessions.set(name, (session = await this.runtime.InferenceSession.create(this.files.get(graph.file)!, this.options)));
    const feeds: Values = {};
    for (const table of graph.tables) feeds[table] = this.tables[table]!;
    for (const input of graph.inputs) feeds[input] = values[input]!;
    return (await session.run(feeds)) as Values;
  }
}

function parse(document: Uint8Array): About {
  try {
    return JSON.parse(new TextDecoder().decode(document)) as About;
  } catch {
    throw new FileError("The portable.json of the camera is damaged. Export the camera again.");
  }
}
