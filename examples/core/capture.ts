/** One photograph as the sensor saw it: the samples, and what its file says of them. */
export type Triple = [number, number, number];

export interface Capture {
  /** Rows one after the other, in stored numbers, never turned. */
  samples: Uint16Array;
  width: number;
  height: number;
  /** Letters of the 2x2 cell at the first sample; unknown for a plain mosaic. */
  cfa?: string;
  /** Stored number without light, by position in the cell. */
  black?: number[];
  /** Stored number at saturation. */
  white?: number;
  /** Gains of red, green and blue, that of green 1. */
  whiteBalance?: Triple;
  iso?: number;
  /** Noise that the file states, of light of which 1.0 is white, before white balance. */
  noise?: { shot: Triple; readVariance: Triple };
  /** x, y of the first sample on the sensor. */
  origin?: [number, number];
  /** EXIF orientation, 1 to 8. */
  orientation: number;
  /** The camera of camkit that the file names. */
  bundle?: string;
  camera: string;
  notes: string[];
}
