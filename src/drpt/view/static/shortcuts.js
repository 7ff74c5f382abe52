// @ts-check
/** Keys: those of the whole page, those of the picture, and the dialog that lists them. */

import { byId, make } from "./dom.js";

const LIST = [
  ["P", "pause and go on"],
  ["R", "restart"],
  ["C", "compare two halves"],
  ["D", "difference: off, to the reference, to the other half"],
  ["E, Shift+E", "exposure up, down"],
  ["+, −", "zoom, on the picture"],
  ["← ↑ ↓ →", "move the picked pixel, on the picture; with Shift by ten"],
  ["← →, Home, End", "move the divider, on the divider"],
  ["Escape", "clear the pixel, on the picture"],
  ["?", "this list"],
  ["click", "pick a pixel and its surface; choose a path"],
  ["right drag, Alt+drag", "orbit"],
  ["wheel", "zoom"],
];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const ZOOMS = { "+": 0.25, "=": 0.25, "-": -0.25 };
const EXPOSURE_STEP = 0.5;
const TEXT = "select, input[type=number]";

/**
 * Listen to the keys of the whole page, except where one writes.
 * @param {import("./view.js").View} view
 * @param {{ pause: () => void, restart: () => void }} actions
 */
export function addShortcuts(view, { pause, restart }) {
  const expose = (stops) => view.show({ exposure: view.look.exposure + stops });
  const keys = {
    p: pause,
    r: restart,
    c: () => view.compare(view.state.halves.length === 1),
    d: () => view.change({ difference: nextDifference(view.state) }),
    e: () => expose(EXPOSURE_STEP),
    E: () => expose(-EXPOSURE_STEP),
    "?": () => byId("keys").showModal(),
  };
  document.addEventListener("keydown", (event) => {
    const writes = event.target instanceof Element && event.target.matches(TEXT);
    if (event.ctrlKey || event.metaKey || event.altKey || writes || byId("keys").open) return;
    const key = event.shiftKey ? event.key : event.key.toLowerCase();
    keys[key]?.();
  });
  addDialog();
}

function nextDifference({ halves, difference }) {
  const kinds = halves.length === 2 ? ["none", "reference", "other"] : ["none", "reference"];
  return kinds[(kinds.indexOf(difference) + 1) % kinds.length];
}

function addDialog() {
  const rows = LIST.map(([keys, what]) =>
    make("div", {}, make("dt", {}, keys), make("dd", {}, what)),
  );
  byId("keys-list").append(...rows);
  byId("help").addEventListener("click", () => byId("keys").showModal());
  byId("keys-close").addEventListener("click", () => byId("keys").close());
}

/**
 * Listen to the keys of the picture.
 * @param {HTMLElement} picture
 * @param {import("./view.js").View} view
 * @param {(pixel: [number, number] | null) => void} pick
 */
export function addPictureKeys(picture, view, pick) {
  picture.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !view.scene) return;
    if (event.target !== picture) return; // but the divider on it
    const { width, height } = view.scene;
    if (event.key in ARROWS) {
      const [column, row] = view.state.pixel ?? [width >> 1, height >> 1];
      const [right, down] = ARROWS[event.key].map((way) => way * (event.shiftKey ? 10 : 1));
      pick([column + right, row + down]);
    } else if (event.key in ZOOMS) {
      view.zoomBy(ZOOMS[event.key]);
    } else if (event.key === "Escape") {
      pick(null);
    } else {
      return;
    }
    event.preventDefault();
  });
}
