declare module "camkit:wasm" {
  /** The WebAssembly of onnxruntime-web, gzip, base64. */
  const packed: string;
  export default packed;
}
declare module "camkit:worker" {
  /** The code of the worker, bundled. */
  const code: string;
  export default code;
}
declare module "onnxruntime-web/ort-wasm-simd-threaded.mjs" {
  /** The JavaScript around the WebAssembly, as text. */
  const code: string;
  export default code;
}
