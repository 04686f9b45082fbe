/** Light as a picture to look at: the sRGB curve (IEC 61966-2-1), turned as the camera was held. */

/** A picture: red, green, blue of a pixel side by side. */
export interface Picture<Values> {
  rgb: Values;
  width: number;
  height: number;
}

function srgb(light: number): number {
  if (!(light > 0)) return 0;
  if (light >= 1) return 1;
  return light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055;
}

export interface Held {
  width: number;
  height: number;
  /** EXIF orientation, 1 to 8. */
  orientation: number;
}

/** Return the picture of three planes of linear Rec.709 light, brighter by some stops. */
export function picture(light: Float32Array, { width, height, orientation }: Held, bits: 8 | 16, stops = 0): Picture<Uint8Array | Uint16Array> {
  const factor = 2 ** stops;
  const pixels = width * height;
  const rgb = bits === 8 ? new Uint8Array(3 * pixels) : new Uint16Array(3 * pixels);
  const top = 2 ** bits - 1;
  const swapped = orientation >= 5;
  const [wide, high] = swapped ? [height, width] : [width, height];
  const mirrorX = [2, 3, 7, 8].includes(orientation); // columns of the stored picture run backwards
  const mirrorY = [3, 4, 6, 7].includes(orientation);
  // the steps of the table are a twentieth of one of 8 bits; 16 bits take the curve itself
  const table = bits === 8 ? Uint8Array.from({ length: 65536 }, (_, i) => Math.round(255 * srgb((i + 0.5) / 65536))) : undefined;
  for (let y = 0, at = 0; y < high; y++) {
    for (let x = 0; x < wide; x++, at += 3) {
      const u = swapped ? y : x;
      const v = swapped ? x : y;
      const from = (mirrorY ? height - 1 - v : v) * width + (mirrorX ? width - 1 - u : u);
      for (let c = 0; c < 3; c++) {
        const value = factor * light[c * pixels + from]!;
        rgb[at + c] = table ? table[value >= 1 ? 65535 : value > 0 ? Math.floor(value * 65536) : 0]! : Math.round(top * srgb(value));
      }
    }
  }
  return { rgb, width: wide, height: high };
}
