// @ts-check
/** How far each half has come: samples, speed, error. */

import { byId, make } from "./dom.js";
import { SIDES, count, settings, short } from "./format.js";

const PARTS = {
  samples: "spp",
  speed: "paths/s",
  error: "relMSE, est.",
  measured: "measured",
  warning: "warning",
};

/**
 * Show the last frame of each half.
 * @param {any} state
 * @param {any[]} headers
 */
export function showReadouts(state, headers) {
  const root = byId("readouts");
  const { halves, spp } = state;
  while (root.children.length > halves.length) root.lastElementChild.remove();
  while (root.children.length < halves.length) root.append(makeReadout());
  halves.forEach((half, index) => {
    const element = root.children[index];
    const name = halves.length === 2 ? `${SIDES[index]}: ` : "";
    element.className = `readout ${SIDES[index]}`;
    element.querySelector("h2").textContent = name + settings(half);
    element.querySelector("progress").value = (headers[index]?.spp ?? 0) / spp;
    for (const [part, text] of Object.entries(textsOf(headers[index], spp))) {
      const place = element.querySelector(`[data-part=${part}]`);
      place.textContent = text;
      place.parentElement.hidden = text === null;
    }
  });
}

function makeReadout() {
  const pairs = Object.entries(PARTS).map(([part, label]) =>
    make("div", {}, make("dt", {}, label), make("dd", { "data-part": part })),
  );
  const progress = make("progress", { max: 1, "aria-label": "samples that are there" });
  return make("section", {}, make("h2"), progress, make("dl", {}, ...pairs));
}

function textsOf(header, spp) {
  if (!header) return { samples: "–", speed: "–", error: "–", measured: null, warning: null };
  return {
    samples: header.done ? `${spp}, done` : `${header.spp} of ${spp}`,
    speed: count(header.paths_per_second),
    error: short(header.error),
    measured: header.measured === null ? null : short(header.measured),
    warning: header.warning,
  };
}
