// @ts-check
/** The panels of the scene, the estimator, the look and the camera. */

import { byId, make } from "./dom.js";
import { SIDES } from "./format.js";
import { NumberField, addFields } from "./number_field.js";

/** Angles above and below the horizon that the slider offers. */
const ELEVATION = 85;
const LABELS = { mode: "Mode", sampler: "Sampler" };

/**
 * Make the controls follow a view, and change it.
 * @param {import("./view.js").View} view
 * @param {{ scenes: string[], modes: string[], samplers: string[] }} choices
 */
export function addControls(view, choices) {
  const parts = [
    addScene(view, choices.scenes),
    addSampling(view),
    addComparison(view),
    addHalves(view, choices),
    addLook(view),
    addCamera(view),
  ];
  view.onChange(() => parts.forEach((refresh) => refresh()));
}

function fill(select, names) {
  select.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
}

function addScene(view, scenes) {
  const select = byId("scene");
  fill(select, scenes);
  select.addEventListener("change", () => view.changeScene(select.value));
  return () => {
    select.value = view.state.scene;
    byId("description").textContent = view.scene?.description ?? "";
    document.title = `${view.state.scene} · drpt view`;
  };
}

function addSampling(view) {
  const field = (label, key) => ({
    label,
    read: () => view.state[key],
    write: (value) => view.change({ [key]: value }),
  });
  const spp = { ...field("spp", "spp"), range: [1, 2 ** 20], logarithmic: true, whole: true };
  return addFields(byId("sampling-fields"), [spp, field("Seed", "seed")]);
}

function addComparison(view) {
  const compare = byId("compare");
  compare.addEventListener("change", () => view.compare(compare.checked));
  const selector = "input[name=difference]";
  const choices = /** @type {HTMLInputElement[]} */ ([...document.querySelectorAll(selector)]);
  for (const input of choices) {
    input.addEventListener("change", () => view.change({ difference: input.value }));
  }
  return () => {
    compare.checked = view.state.halves.length === 2;
    for (const input of choices) {
      input.checked = input.value === view.state.difference;
      input.disabled = input.value === "other" && !compare.checked;
    }
  };
}

function addHalves(view, { modes, samplers }) {
  const halves = SIDES.map((side, index) => {
    const half = makeHalf(view, index, side, { mode: modes, sampler: samplers });
    byId("halves").append(half.element);
    return half;
  });
  return () => {
    const { length } = view.state.halves;
    halves.forEach(({ element, refresh }, index) => {
      element.hidden = index >= length;
      if (!element.hidden) refresh();
    });
    halves[0].legend.textContent = length === 2 ? "Left half" : "Picture";
  };
}

function makeHalf(view, index, side, choices) {
  const selects = Object.entries(choices).map(([key, names]) => {
    const select = make("select", { id: `${key}-${index}`, className: "wide" });
    fill(select, names);
    select.addEventListener("change", () => view.changeHalf(index, { [key]: select.value }));
    return { key, select };
  });
  const bounces = new NumberField({
    label: "Bounces",
    range: [0, 16],
    step: 1,
    read: () => view.state.halves[index].bounces,
    write: (value) => view.changeHalf(index, { bounces: value }),
  });
  const rows = selects.map(({ key, select }) =>
    make("div", { className: "field" }, make("label", { htmlFor: select.id }, LABELS[key]), select),
  );
  const legend = make("legend", {}, `${side === "left" ? "Left" : "Right"} half`);
  const className = `half ${side}`;
  return {
    element: make("fieldset", { className }, legend, ...rows, bounces.element),
    legend,
    refresh() {
      for (const { key, select } of selects) select.value = view.state.halves[index][key];
      bounces.refresh();
    },
  };
}

function addLook(view) {
  const field = (label, key, range, rest) => ({
    label,
    range,
    ...rest,
    read: () => view.look[key],
    write: (value) => view.show({ [key]: value }),
  });
  const scale = field("Scale", "scale", [0.01, 10], { logarithmic: true, unit: "±" });
  const read = () => (view.state.difference === "none" ? null : view.look.scale);
  return addFields(byId("look-fields"), [
    field("Exposure", "exposure", [-8, 8], { step: 0.25, unit: "stops" }),
    { ...scale, read },
  ]);
}

function addCamera(view) {
  const field = (label, key, range, step, unit) => ({
    label,
    range,
    step,
    unit,
    read: () => view.state.camera[key],
    write: (value) => view.move({ [key]: value }),
  });
  byId("camera-reset").addEventListener("click", () =>
    view.move({ azimuth: 0, elevation: 0, zoom: 0 }),
  );
  return addFields(byId("camera-fields"), [
    field("Azimuth", "azimuth", [-180, 180], 1, "°"),
    field("Elevation", "elevation", [-ELEVATION, ELEVATION], 1, "°"),
    field("Zoom", "zoom", [-4, 6], 0.1, "stops"),
  ]);
}
