// @ts-check
/** Numbers as people read them. */

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
export const SIDES = ["left", "right"];

/** Write a number with three digits: 0.123, 12.3, 1.23·10⁻⁵. */
export function short(value) {
  if (value === null || !Number.isFinite(value)) return value === null ? "–" : String(value);
  const size = Math.abs(value);
  if (size === 0 || (size >= 1e-3 && size < 1e5)) return String(Number(value.toPrecision(3)));
  const [digits, exponent] = value.toExponential(2).split("e");
  return `${digits}·${power(Number(exponent))}`;
}

/** Write a power of ten: 10⁻⁵. */
export function power(exponent) {
  const digits = [...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[Number(digit)]);
  return `10${exponent < 0 ? "⁻" : ""}${digits.join("")}`;
}

/** Write a large count: 950, 12.3 k, 4.5 M. */
export function count(value) {
  if (value >= 1e6) return `${short(value / 1e6)} M`;
  return value >= 1e4 ? `${short(value / 1e3)} k` : String(Math.round(value));
}

/** Name a shape as messages of the scene model do. */
export function shapeName(index) {
  return `shapes[${index}]`;
}

/** Write what a half is rendered with. */
export function settings({ mode, sampler, bounces }) {
  return `${mode} · ${sampler} · ${bounces} bounce${bounces === 1 ? "" : "s"}`;
}
