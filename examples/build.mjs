// Build the programs in node/dist, and browser/dist/index.html: one file that needs nothing beside it.
import { build } from "esbuild";
import { mkdir, readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const usual = { bundle: true, target: "es2022", minify: true, write: false, logLevel: "warning" };
const asText = (text) => ({ contents: text, loader: "text" });

/** Modules of the page that are made here. */
const made = {
  name: "made",
  setup({ onResolve, onLoad }) {
    onResolve({ filter: /^camkit:/ }, ({ path }) => ({ path, namespace: "made" }));
    onLoad({ filter: /wasm$/, namespace: "made" }, async () => {
      const wasm = await readFile(fileURLToPath(import.meta.resolve("onnxruntime-web/ort-wasm-simd-threaded.wasm")));
      return asText(gzipSync(wasm, { level: 9 }).toString("base64"));
    });
    onLoad({ filter: /worker$/, namespace: "made" }, async () => {
      const conditions = ["onnxruntime-web-use-extern-wasm"];
      const worker = await build({ ...usual, entryPoints: ["browser/worker.ts"], format: "iife", platform: "browser", conditions });
      return asText(worker.outputFiles[0].text);
    });
    onLoad({ filter: /ort-wasm-simd-threaded\.mjs$/ }, async ({ path }) => asText(await readFile(path, "utf8")));
  },
};

const [page, markup, style] = await Promise.all([
  build({ ...usual, entryPoints: ["browser/page.ts"], format: "iife", platform: "browser", plugins: [made] }),
  readFile("browser/page.html", "utf8"),
  readFile("browser/style.css", "utf8"),
  build({
    ...usual, minify: false, write: true, entryPoints: ["node/develop.ts", "node/read.ts"], outdir: "node/dist",
    outExtension: { ".js": ".mjs" }, format: "esm", platform: "node", packages: "external",
  }),
]);
const script = page.outputFiles[0].text.replaceAll("</script", "<\\/script");
const whole = markup.replace("{{style}}", () => style).replace("{{script}}", () => script);
await mkdir("browser/dist", { recursive: true });
await writeFile("browser/dist/index.html", whole);
console.log(`browser/dist/index.html, ${(whole.length / 1e6).toFixed(1)} MB`);
