// @ts-check
/** Colours of radiance and of signed differences. */

/** Encode linear light as an sRGB level from 0 to 255 (IEC 61966-2-1). */
export function srgb(linear) {
  const value = Math.min(Math.max(linear, 0), 1);
  const encoded = value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
  return Math.round(255 * encoded);
}

/** The CSS colour of a radiance at an exposure in stops. */
export function css(rgb, exposure = 0) {
  return `rgb(${rgb.map((value) => srgb(value * 2 ** exposure)).join(" ")})`;
}

/** Pack levels into the 32 bits of a pixel of a canvas on little-endian machines. */
export function pack(r, g, b) {
  return (0xff000000 | (b << 16) | (g << 8) | r) >>> 0;
}

export const MAGENTA = pack(255, 0, 255);

/** From too dark to too bright, told apart by every colour vision; light: ColorBrewer's RdBu. */
const STOPS = {
  light: ["053061", "2166ac", "92c5de", "f7f7f7", "f4a582", "b2182b", "67001f"],
  dark: ["c4e4ff", "3aa0ff", "12508f", "0a0a0a", "8a4a00", "ff8c1a", "ffe2b8"],
};
export const STEPS = 255;

/**
 * Return the colours of differences from -1 to 1 in `STEPS` steps.
 * @param {"light" | "dark"} theme the middle is white or black
 */
export function diverging(theme) {
  const channels = (hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16));
  const stops = STOPS[theme].map(channels);
  return Uint32Array.from({ length: STEPS }, (_, step) => {
    const place = (step / (STEPS - 1)) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    const [r, g, b] = [0, 1, 2].map((c) =>
      Math.round(stops[low][c] + (place - low) * (stops[low + 1][c] - stops[low][c])),
    );
    return pack(r, g, b);
  });
}
