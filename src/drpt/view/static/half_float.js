// @ts-check
/** Half floats by table: every one of their 65536 patterns of bits has its entry. */

import { srgb } from "./colours.js";

/** A level that no colour has: the value is not a number. */
export const NOT_A_NUMBER = 256;

/** The value of each pattern of bits (IEEE 754, binary16). */
export const VALUES = Float32Array.from({ length: 1 << 16 }, (_, bits) => valueOf(bits));

function valueOf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  return sign * (1024 + fraction) * 2 ** (exponent - 25);
}

/** Return the sRGB level of each pattern of bits at an exposure in stops. */
export function levels(exposure) {
  const gain = 2 ** exposure;
  return Uint16Array.from(VALUES, (value) => (isNaN(value) ? NOT_A_NUMBER : srgb(value * gain)));
}
