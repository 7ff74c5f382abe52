// @ts-check
/** The picked pixel and the paths through it, drawn over the picture. */

import { draw } from "./dom.js";

const SMALLEST_MARK = 8;

/**
 * @typedef {object} Drawing
 * @property {[number, number] | null} pixel
 * @property {any[]} paths
 * @property {number} chosen index of a path
 * @property {number} scale of the picture: CSS pixels to a pixel
 * @property {(index: number) => void} choose
 */

/**
 * Draw on a layer that covers the picture.
 * @param {SVGElement} svg
 * @param {Drawing} drawing
 */
export function drawOverlay(svg, { pixel, paths, chosen, scale, choose }) {
  const others = paths.flatMap((path, i) => (i === chosen ? [] : [ray(path, scale, i, choose)]));
  const path = paths[chosen];
  svg.replaceChildren(
    ...(pixel ? [frame(pixel, scale)] : []),
    ...others,
    ...(path
      ? [...lights(path, scale), ray(path, scale, chosen, choose), ...marks(path, scale)]
      : []),
  );
  svg.querySelectorAll(".ray")[others.length]?.classList.add("chosen");
}

/** A path as a line that can be clicked; what lies behind the camera is left out. */
function ray({ vertices }, scale, index, choose) {
  const points = vertices.map(({ at }) => at && at.map((value) => (value * scale).toFixed(1)));
  const pieces = points.map((point, i) => point && `${i && points[i - 1] ? "L" : "M"}${point}`);
  const d = pieces.filter(Boolean).join("");
  const group = draw(
    "g",
    { class: "ray", "data-path": index },
    ...["target", "casing", "line"].map((name) => draw("path", { class: name, d })),
  );
  group.addEventListener("click", (event) => {
    event.stopPropagation();
    choose(index);
  });
  return group;
}

/** Lines from the vertices of a path to the points of lights that they looked at. */
function lights({ vertices }, scale) {
  const seen = vertices.filter(({ at, light }) => at && light?.at);
  return seen.map(({ at, light }) => {
    const [x1, y1, x2, y2] = [...at, ...light.at].map((value) => value * scale);
    const kind = light.visible ? "visible" : "blocked";
    return draw("line", { class: `light ${kind}`, x1, y1, x2, y2 });
  });
}

/** The vertices of a path, numbered as in its table. */
function marks({ vertices }, scale) {
  return vertices.flatMap(({ at }, i) => {
    if (!at) return [];
    const [cx, cy] = at.map((value) => value * scale);
    const circle = draw("circle", { cx, cy, r: 8 });
    return [draw("g", { class: "vertex" }, circle, draw("text", { x: cx, y: cy + 4 }, `${i + 1}`))];
  });
}

/** A frame around the picked pixel, larger than that where it is small. */
function frame([column, row], scale) {
  const width = Math.max(scale, SMALLEST_MARK);
  const [x, y] = [column, row].map((value) => (value + 0.5) * scale - width / 2);
  const place = { x, y, width, height: width };
  const casing = draw("rect", { class: "casing", ...place });
  return draw("g", { class: "pick" }, casing, draw("rect", { class: "line", ...place }));
}
