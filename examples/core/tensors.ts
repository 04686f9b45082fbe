/** Tensors of a safetensors file: length of the header, header as JSON, numbers. */
import { check } from "./error.js";

const KINDS = { F32: Float32Array, F64: Float64Array, I64: BigInt64Array, I32: Int32Array, U16: Uint16Array, U8: Uint8Array };

export interface Numbers {
  type: keyof typeof KINDS | "F16";
  shape: number[];
  data: Float32Array | Float64Array | BigInt64Array | Int32Array | Uint16Array | Uint8Array;
}

/** Read all tensors; numbers of half precision are left as the 16 bits that they are. */
export function readTensors(bytes: Uint8Array): Map<string, Numbers> {
  const damaged = "The tables of the camera are damaged. Export the camera again.";
  check(bytes.length > 8, damaged);
  const length = Number(new DataView(bytes.buffer, bytes.byteOffset).getBigUint64(0, true));
  check(8 + length <= bytes.length, damaged);
  const header: Record<string, { dtype: Numbers["type"]; shape: number[]; data_offsets: [number, number] }> = JSON.parse(new TextDecoder().decode(bytes.subarray(8, 8 + length)));
  const tensors = new Map<string, Numbers>();
  for (const [name, entry] of Object.entries(header)) {
    if (name === "__metadata__") continue;
    const { dtype: type, shape } = entry;
    const [first, end] = entry.data_offsets;
    const Kind = type === "F16" ? Uint16Array : KINDS[type];
    const count = shape.reduce((product, n) => product * n, 1);
    check(Kind && end - first === count * Kind.BYTES_PER_ELEMENT && 8 + length + end <= bytes.length, damaged);
    // a copy, since numbers in the file may lie at any byte; a Buffer of node would copy nothing
    const copy = Uint8Array.from(bytes.subarray(8 + length + first, 8 + length + end));
    tensors.set(name, { type, shape, data: new Kind(copy.buffer, 0, count) });
  }
  return tensors;
}
