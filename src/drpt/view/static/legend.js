// @ts-check
/** The scale of the difference's colours, and how large the difference is. */

import { STEPS } from "./colours.js";
import { byId } from "./dom.js";
import { SIDES, count, short } from "./format.js";
import { differenceColours } from "./picture.js";

/** Draw the colours of the theme that is on. */
export function drawScale() {
  const context = byId("legend-scale").getContext("2d");
  const image = context.createImageData(STEPS, 1);
  new Uint32Array(image.data.buffer).set(differenceColours());
  context.putImageData(image, 0, 0);
}

/**
 * Show what the colours mean, and the measured errors that came with the frames.
 * @param {"none" | "reference" | "other"} difference
 * @param {number} scale the difference that has the last colour
 * @param {any[]} headers of the last frame of each half
 */
export function showLegend(difference, scale, headers) {
  byId("legend").hidden = difference === "none";
  byId("legend-low").textContent = `−${short(scale)}`;
  byId("legend-high").textContent = `+${short(scale)}`;
  const than = difference === "other" ? "the other half" : "the reference";
  byId("legend-scale").setAttribute(
    "aria-label",
    `Colours from ${short(scale)} darker to ${short(scale)} brighter than ${than}`,
  );
  byId("legend-text").textContent = `(x − y) / √(y² + 0.01), x: the picture, y: ${than}${measured(headers)}`;
}

function measured(headers) {
  const known = headers.filter((header) => header?.measured != null);
  const errors = known.map(({ half, measured }) =>
    headers.length === 2 ? `${SIDES[half]} ${short(measured)}` : short(measured),
  );
  return known.length ? `, ${count(known[0].reference_spp)} spp; relMSE ${errors.join(", ")}` : "";
}
