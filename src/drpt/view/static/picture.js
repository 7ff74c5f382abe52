// @ts-check
/** The picture: the last frame of each half, drawn on the canvas beside the divider. */

import { MAGENTA, STEPS, diverging, pack } from "./colours.js";
import { NOT_A_NUMBER, VALUES, levels } from "./half_float.js";

const DARK = matchMedia("(prefers-color-scheme: dark)");

/** The colours of differences in the theme that is on, and a listener for another one. */
export const differenceColours = () => diverging(DARK.matches ? "dark" : "light");
export const onTheme = (listener) => DARK.addEventListener("change", listener);

/**
 * @typedef {{ exposure: number, scale: number, divider: number }} Look
 * @typedef {{ stops: number, radiance: Uint16Array, difference?: Uint16Array }} Images half floats,
 *   three to a pixel; the radiance is brighter by so many stops
 */

/** One for each half, at the exposures before and after a change. */
const TABLES = 4;

export class Picture {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    /** @type {Images[]} */
    this.halves = [];
    /** Tables of levels by exposure: those that were used last. */
    this.levels = new Map();
    this.setTheme();
  }

  /** Take the colours of the theme that is on. */
  setTheme() {
    this.differences = differenceColours();
  }

  /**
   * Keep a frame of a half, to be drawn next time.
   * @param {{ half: number, width: number, height: number, stops: number, images: string[] }} header
   * @param {ArrayBuffer} buffer
   * @param {number} start where the images begin
   */
  take({ half, width, height, stops, images }, buffer, start) {
    if (width !== this.canvas.width || height !== this.canvas.height) {
      Object.assign(this.canvas, { width, height });
      this.halves = [];
    }
    const size = 3 * width * height;
    const arrays = images.map((name, i) => [
      name,
      new Uint16Array(buffer, start + 2 * size * i, size),
    ]);
    this.halves[half] = { stops, ...Object.fromEntries(arrays) };
  }

  /**
   * Draw the halves.
   * @param {Look} look
   * @param {number} count how many halves there are
   */
  draw({ exposure, scale, divider }, count) {
    const { width, height } = this.canvas;
    const context = this.canvas.getContext("2d");
    if (!context) return;
    const image = context.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const edge = count === 2 ? Math.round(divider * width) : width;
    this.#paint(pixels, 0, [0, edge], exposure, scale);
    this.#paint(pixels, 1, [edge, width], exposure, scale);
    context.putImageData(image, 0, 0);
  }

  /** Paint some columns of one half: its difference if it has one, else its radiance. */
  #paint(pixels, half, [from, to], exposure, scale) {
    const images = this.halves[half];
    if (!images) return;
    const values = images.difference ?? images.radiance;
    const colour = images.difference
      ? this.#differenceColour(scale)
      : this.#radianceColour(exposure + images.stops);
    const { width, height } = this.canvas;
    for (let y = 0; y < height; y++) {
      for (let x = from; x < to; x++) {
        const i = 3 * (y * width + x);
        pixels[y * width + x] = colour(values[i], values[i + 1], values[i + 2]);
      }
    }
  }

  /** Return a function from the bits of three half floats to a pixel. */
  #radianceColour(exposure) {
    const level = this.levels.get(exposure) ?? levels(exposure);
    this.levels.delete(exposure);
    this.levels.set(exposure, level);
    if (this.levels.size > TABLES) this.levels.delete(this.levels.keys().next().value);
    return (r, g, b) =>
      (level[r] | level[g] | level[b]) & NOT_A_NUMBER
        ? MAGENTA
        : pack(level[r], level[g], level[b]);
  }

  /** The same for a difference, of which the mean of the channels is shown. */
  #differenceColour(scale) {
    const middle = (STEPS - 1) / 2;
    const gain = middle / (3 * scale);
    const colours = /** @type {Uint32Array} */ (this.differences);
    return (r, g, b) => {
      const step = Math.round(middle + gain * (VALUES[r] + VALUES[g] + VALUES[b]));
      return isNaN(step) ? MAGENTA : colours[Math.min(Math.max(step, 0), STEPS - 1)];
    };
  }
}
