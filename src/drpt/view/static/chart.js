// @ts-check
/** Error against time, both on logarithmic axes. */

import { draw } from "./dom.js";
import { SIDES, power } from "./format.js";

const LEFT = 50;
const RIGHT = 300;
const TOP = 8;
const BOTTOM = 160;
/** Points nearer than this ratio of times replace each other, so that a curve stays short. */
const SPACING = 1.04;
const KINDS = ["error", "measured"];

export class Chart {
  /** @param {SVGElement} svg */
  constructor(svg) {
    this.svg = svg;
    /** @type {any[][]} the headers of frames, by half */
    this.curves = [];
  }

  /** Take a frame's header; one with fewer samples than the last begins a new curve. */
  add(header) {
    const curve = (this.curves[header.half] ??= []);
    if (curve.length && header.spp < curve.at(-1).spp) curve.length = 0;
    const same = curve.at(-1)?.spp === header.spp;
    if (same || header.seconds < curve.at(-2)?.seconds * SPACING) curve.pop();
    if (header.seconds > 0) curve.push(header);
  }

  /** Draw the curves of some halves. */
  draw(halves) {
    const curves = this.curves.slice(0, halves);
    const points = curves.flatMap((curve, half) =>
      KINDS.flatMap((kind) => curve.filter((h) => h[kind] > 0).map((h) => ({ half, kind, h }))),
    );
    const x = axis(
      points.map(({ h }) => h.seconds),
      LEFT,
      RIGHT,
    );
    const y = axis(
      points.map(({ h, kind }) => h[kind]),
      BOTTOM,
      TOP,
    );
    this.svg.replaceChildren(
      ...gridX(x),
      ...gridY(y),
      ...curves.flatMap((curve, half) => KINDS.map((kind) => line(curve, half, kind, x, y))),
    );
    const last = points.at(-1);
    const text = last
      ? `relMSE ${last.h[last.kind].toExponential(1)} after ${last.h.seconds} s`
      : "";
    this.svg.setAttribute("aria-label", `Error against time, both logarithmic. ${text}`);
  }
}

/** An axis over whole powers of ten: where a value stands, and which powers there are. */
function axis(values, from, to) {
  const logs = values.length ? values.map(Math.log10) : [-1, 0];
  const low = Math.floor(Math.min(...logs));
  const high = Math.max(Math.ceil(Math.max(...logs)), low + 1);
  const at = (log) => from + ((log - low) / (high - low)) * (to - from);
  const powers = Array.from({ length: high - low + 1 }, (_, i) => low + i);
  return { powers, at: (value) => at(Math.log10(value)), atPower: at };
}

function gridX({ powers, atPower }) {
  const lines = powers.flatMap((exponent) => {
    const x = atPower(exponent);
    const label = Math.abs(exponent) < 3 ? String(10 ** exponent) : power(exponent);
    return [
      draw("line", { class: "grid", x1: x, x2: x, y1: TOP, y2: BOTTOM }),
      draw("text", { x, y: BOTTOM + 16, "text-anchor": "middle" }, label),
    ];
  });
  const x = (LEFT + RIGHT) / 2;
  return [...lines, draw("text", { x, y: BOTTOM + 34, "text-anchor": "middle" }, "seconds")];
}

function gridY({ powers, atPower }) {
  const lines = powers.flatMap((exponent) => {
    const y = atPower(exponent);
    return [
      draw("line", { class: "grid", x1: LEFT, x2: RIGHT, y1: y, y2: y }),
      draw("text", { x: LEFT - 6, y: y + 4, "text-anchor": "end" }, power(exponent)),
    ];
  });
  const turn = `rotate(-90 9 ${(TOP + BOTTOM) / 2})`;
  const middle = { x: 9, y: (TOP + BOTTOM) / 2, "text-anchor": "middle", transform: turn };
  return [...lines, draw("text", middle, "relMSE")];
}

function line(curve, half, kind, x, y) {
  const known = curve.filter((header) => header[kind] > 0);
  const points = known.map((h) => [x.at(h.seconds).toFixed(1), y.at(h[kind]).toFixed(1)]);
  const ends = points.slice(-1).map(([cx, cy]) => draw("circle", { cx, cy, r: 2.5 }));
  const polyline = draw("polyline", { points: points.join(" ") });
  return draw("g", { class: `curve ${SIDES[half]} ${kind}` }, polyline, ...ends);
}
