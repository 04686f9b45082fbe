"use strict";

/** Unpack text of base64, deflated or plain. */
function bytesOf(text) {
  const raw = atob(text);
  return Uint8Array.from({ length: raw.length }, (_, i) => raw.charCodeAt(i));
}
async function inflated(text) {
  const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Codes of the logarithm of light, (3, h, w), of their differences along rows. */
async function lightCodes(text, width, height) {
  const halves = await inflated(text), count = 3 * width * height, codes = new Uint16Array(count);
  for (let i = 0; i < count; i++) {
    const step = halves[i] | (halves[count + i] << 8);
    codes[i] = i % width ? codes[i - 1] + step : step;
  }
  return codes;
}
const TOP_CODE = 4095, DARKEST = 2 ** -12;
function lightOf(code, stops) {
  return code ? DARKEST * 2 ** ((code - 1) * stops / (TOP_CODE - 1)) : 0;
}
function srgb(light) {
  const x = Math.min(1, light);
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}
function imageOf(address) {
  return new Promise((keep, fail) => {
    const image = new Image();
    image.onload = () => keep(image);
    image.onerror = () => fail(new Error("a picture of this page cannot be decoded"));
    image.src = address;
  });
}

function choose(viewer, count, show) {
  const buttons = [...viewer.querySelectorAll(".choice button")];
  buttons.forEach((button, number) => {
    button.onclick = () => {
      buttons.forEach(one => one.setAttribute("aria-pressed", String(one === button)));
      show(number);
    };
  });
  return show(0);
}

function pictureViewer(viewer, data) {
  const get = name => viewer.querySelector(name);
  const stage = get(".stage"), layers = get(".layers"), cover = get(".cover"), line = get(".line");
  const split = get(".split"), exposure = get(".exposure"), cells = get("input.cells");
  const zoom = get(".zoom"), readout = get(".readout");
  const sides = ["before", "after"].filter(side => get(`canvas.${side}`));
  const canvases = Object.fromEntries(sides.map(side => [side, get(`canvas.${side}`)]));
  const held = new Map(); // number of a part -> what its sides show
  let part = 0, isFit = true;

  const load = number => {
    if (!held.has(number)) {
      const { width, height, ...view } = data.views[number];
      held.set(number, Promise.all(sides.map(side =>
        data.stops ? lightCodes(view[side], width, height) : imageOf(view[side]))));
    }
    return held.get(number);
  };
  const paintLight = (canvas, codes) => {
    const { width, height } = canvas, count = width * height;
    const gain = 2 ** exposure.valueAsNumber;
    const table = Uint8Array.from({ length: TOP_CODE + 1 }, (_, code) =>
      Math.round(255 * srgb(gain * lightOf(code, data.stops))));
    const image = new ImageData(width, height), out = image.data;
    for (let i = 0; i < count; i++) {
      out[4 * i] = table[codes[i]];
      out[4 * i + 1] = table[codes[count + i]];
      out[4 * i + 2] = table[codes[2 * count + i]];
      out[4 * i + 3] = 255;
    }
    canvas.getContext("2d").putImageData(image, 0, 0);
  };
  const paint = async () => {
    const number = part, view = data.views[number], shown = await load(number);
    if (number !== part) return;
    sides.forEach((side, i) => {
      const canvas = canvases[side];
      if (canvas.width !== view.width || canvas.height !== view.height)
        [canvas.width, canvas.height] = [view.width, view.height];
      if (data.stops) paintLight(canvas, shown[i]);
      else canvas.getContext("2d").drawImage(shown[i], 0, 0);
      canvas.setAttribute("aria-label", `${data.name}, ${view.name}, ${side} restoration`);
    });
    paintCells(view);
    place();
    viewer.dataset.shown = String(number);
  };
  const paintCells = view => {
    [cover.width, cover.height] = [view.width, view.height];
    cover.hidden = !cells?.checked;
    if (cover.hidden) return;
    const pen = cover.getContext("2d"), colours = { P: "#e8590c", W: "#1971c2", S: "#2f9e44" };
    pen.font = `bold ${view.step > 1 ? 14 : 24}px system-ui, sans-serif`;
    for (const [left, top, width, height, letter] of data.cells) {
      const x = (left - view.left) / view.step, y = (top - view.top) / view.step;
      pen.fillStyle = pen.strokeStyle = colours[letter];
      pen.globalAlpha = 0.3;
      pen.fillRect(x, y, width / view.step, height / view.step);
      pen.globalAlpha = 1;
      pen.strokeRect(x + 0.5, y + 0.5, width / view.step - 1, height / view.step - 1);
      pen.lineWidth = 3;
      pen.strokeStyle = "#000";
      pen.strokeText(letter, x + 5, y + (view.step > 1 ? 15 : 26));
      pen.fillStyle = "#fff";
      pen.fillText(letter, x + 5, y + (view.step > 1 ? 15 : 26));
      pen.lineWidth = 1;
    }
  };
  /** Lay out the canvases, and the border between before and after where the slider stands. */
  const place = () => {
    const view = data.views[part], natural = 1 / devicePixelRatio;
    const room = viewer.clientWidth / view.width;
    const isLarge = natural > room;
    const scale = isFit || view.step > 1 ? Math.min(natural, room) : natural;
    zoom.hidden = view.step > 1 || !isLarge;
    zoom.textContent = isFit ? "Show at 100 %" : "Fit into the page";
    for (const canvas of [...Object.values(canvases), cover]) canvas.style.width = `${view.width * scale}px`;
    const share = Math.round(100 * scale / natural / view.step);
    viewer.dataset.percent = String(share);
    if (!readout.dataset.pointed) readout.textContent = `Shown at ${share} %.`;
    if (!line) return;
    const { after } = canvases;
    const seen = Math.min(stage.clientWidth, after.clientWidth);
    const at = stage.scrollLeft + split.valueAsNumber / 100 * seen;
    after.style.clipPath = `inset(0 0 0 ${at}px)`;
    line.style.left = `${at}px`;
  };
  const move = steps => {
    split.valueAsNumber += steps;
    place();
  };
  const expose = stops => {
    exposure.valueAsNumber += stops;
    exposure.dispatchEvent(new Event("input"));
  };
  viewer.addEventListener("keydown", event => {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    if (exposure && ["+", "=", "-"].includes(event.key)) expose(event.key === "-" ? -0.5 : 0.5);
    else if (split && event.target === stage && ["ArrowLeft", "ArrowRight"].includes(event.key))
      move(event.key === "ArrowLeft" ? -1 : 1);
    else return;
    event.preventDefault();
  });
  if (line) {
    line.onpointerdown = event => line.setPointerCapture(event.pointerId);
    line.onpointermove = event => {
      if (!line.hasPointerCapture(event.pointerId)) return;
      const box = stage.getBoundingClientRect();
      split.valueAsNumber = 100 * (event.clientX - box.left) / Math.min(stage.clientWidth, canvases.after.clientWidth);
      place();
    };
    split.oninput = place;
  }
  if (exposure) exposure.oninput = () => {
    const stops = exposure.valueAsNumber;
    exposure.parentElement.querySelector("output").textContent = `${stops > 0 ? "+" : ""}${stops} EV`;
    void paint();
  };
  if (cells) cells.onchange = () => paintCells(data.views[part]);
  zoom.onclick = () => {
    isFit = !isFit;
    place();
  };
  layers.onpointermove = async event => {
    if (!data.stops) return;
    const view = data.views[part], box = canvases.after.getBoundingClientRect(), count = view.width * view.height;
    const x = Math.floor((event.clientX - box.left) / box.width * view.width);
    const y = Math.floor((event.clientY - box.top) / box.height * view.height);
    if (x < 0 || y < 0 || x >= view.width || y >= view.height) return;
    const shown = await load(part), at = y * view.width + x;
    const texts = sides.map((side, i) => `${side} ${[0, 1, 2].map(c =>
      lightOf(shown[i][c * count + at], data.stops).toPrecision(3)).join(", ")}`);
    readout.dataset.pointed = "yes";
    readout.textContent = `x ${view.left + x * view.step}, y ${view.top + y * view.step}; light (R, G, B), white = 1: ${texts.join("; ")}`;
  };
  stage.addEventListener("scroll", place);
  addEventListener("resize", place);
  return choose(viewer, data.views.length, number => {
    part = number;
    isFit = number === 0 && data.views[0].step > 1;
    delete readout.dataset.pointed;
    stage.scrollTo(0, 0);
    return paint();
  });
}

/** Size a canvas of few pixels so that each is a whole number of pixels of the page, if it can be. */
function enlarge(viewer, canvas) {
  const times = Math.min(viewer.clientWidth, 1024) / canvas.width;
  canvas.style.width = `${canvas.width * (times >= 2 ? Math.floor(times) : times)}px`;
}

async function mapViewer(viewer, data) {
  const get = name => viewer.querySelector(name);
  const canvas = get(".values"), ramp = get(".ramp"), cross = get(".cross"), readout = get(".readout");
  const { width, height, maps } = data;
  for (const one of maps) {
    one.numbers = new Float32Array((await inflated(one.values)).buffer);
    one.table = bytesOf(one.colours);
    delete one.values;
  }
  const text = (one, value) => Number.isNaN(value) ? "not valid" : `${value.toPrecision(4)} ${one.unit}`;
  const colour = (one, share) => {
    const place = Math.round(255 * Math.min(1, Math.max(0, one.turned ? 1 - share : share)));
    return one.table.subarray(3 * place, 3 * place + 3);
  };
  let at = null;
  const place = () => {
    enlarge(viewer, canvas);
    cross.hidden = !at;
    if (!at) return;
    const side = canvas.clientWidth / width;
    Object.assign(cross.style, { left: `${at[0] * side - 2}px`, top: `${at[1] * side - 2}px`,
      width: `${side + 4}px`, height: `${side + 4}px` });
  };
  const read = (x, y) => {
    at = [Math.min(width - 1, Math.max(0, x)), Math.min(height - 1, Math.max(0, y))];
    const here = at[1] * width + at[0];
    readout.textContent = `x ${at[0] * data.stride}, y ${at[1] * data.stride}: ` +
      maps.map(one => `${one.name.toLowerCase()} ${text(one, one.numbers[here])}`).join("; ");
    place();
  };
  canvas.onpointermove = canvas.onpointerdown = event => {
    const box = canvas.getBoundingClientRect();
    read(Math.floor((event.clientX - box.left) / box.width * width),
      Math.floor((event.clientY - box.top) / box.height * height));
  };
  get(".stage").addEventListener("keydown", event => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step) return;
    event.preventDefault();
    if (at) read(at[0] + step[0], at[1] + step[1]);
    else read(width >> 1, height >> 1);
  });
  addEventListener("resize", place);
  return choose(viewer, maps.length, number => {
    const one = maps[number], image = new ImageData(width, height);
    [canvas.width, canvas.height] = [width, height];
    one.numbers.forEach((value, i) => {
      image.data.set(Number.isNaN(value) ? [48, 48, 48] : colour(one, (value - one.low) / (one.high - one.low)), 4 * i);
      image.data[4 * i + 3] = 255;
    });
    canvas.getContext("2d").putImageData(image, 0, 0);
    canvas.setAttribute("aria-label", `${data.name}: ${one.name} from ${text(one, one.low)} to ${text(one, one.high)}`);
    get(".low").textContent = text(one, one.low);
    get(".high").textContent = text(one, one.high);
    const strip = new ImageData(256, 1);
    for (let i = 0; i < 256; i++) {
      strip.data.set(colour(one, i / 255), 4 * i);
      strip.data[4 * i + 3] = 255;
    }
    ramp.getContext("2d").putImageData(strip, 0, 0);
    place();
    viewer.dataset.shown = String(number);
  });
}

async function filmViewer(viewer, data) {
  const get = name => viewer.querySelector(name);
  const canvas = get(".values"), frame = get(".frame"), play = get(".play"), output = get("output");
  const { width, height } = data, count = width * height, codes = await inflated(data.frames);
  let timer = 0;
  [canvas.width, canvas.height] = [width, height];
  const show = () => {
    const number = frame.valueAsNumber, image = new ImageData(width, height);
    for (let i = 0; i < count; i++) {
      image.data.fill(codes[number * count + i], 4 * i, 4 * i + 3);
      image.data[4 * i + 3] = 255;
    }
    canvas.getContext("2d").putImageData(image, 0, 0);
    output.textContent = data.labels[number];
    viewer.dataset.shown = String(number);
  };
  frame.oninput = show;
  play.onclick = event => {
    event.preventDefault();
    clearInterval(timer);
    const isOn = play.getAttribute("aria-pressed") !== "true";
    play.setAttribute("aria-pressed", String(isOn));
    play.textContent = isOn ? "Pause" : "Play";
    if (isOn) timer = setInterval(() => {
      frame.valueAsNumber = (frame.valueAsNumber + 1) % data.labels.length;
      show();
    }, 80);
  };
  const place = () => enlarge(viewer, canvas);
  addEventListener("resize", place);
  place();
  show();
}

const VIEWERS = { picture: pictureViewer, maps: mapViewer, film: filmViewer };
for (const viewer of document.querySelectorAll(".viewer")) {
  const data = JSON.parse(viewer.querySelector("script").textContent);
  Promise.resolve(VIEWERS[viewer.dataset.kind](viewer, data)).catch(error => {
    const note = document.createElement("p");
    note.className = "bad";
    note.setAttribute("role", "alert");
    note.textContent = `This picture cannot be shown: ${error.message}`;
    viewer.prepend(note);
  });
}
