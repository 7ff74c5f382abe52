// @ts-check
/** Controls of one shape: of a light its size and place, of a surface what it reflects. */

import { make } from "./dom.js";
import { css } from "./colours.js";
import { shapeName, short } from "./format.js";
import { NumberField } from "./number_field.js";

const AXES = ["x", "y", "z"];
const CHANNELS = ["Red", "Green", "Blue"];
/** How much smaller and larger than it was a sphere is made by its slider. */
const RADII = [1 / 16, 4];
/** How far a sphere is moved by its sliders, as a part of its distance from the camera. */
const REACH = 0.25;
const EXPONENTS = /** @type {[number, number]} */ ([1, 1e5]);
const FIRST_EXPONENT = 50;

export class ShapeEditor {
  /**
   * @param {HTMLElement} root the panel, which has a heading
   * @param {import("./view.js").View} view
   * @param {"light" | "surface"} kind the part of the look that holds the chosen index
   */
  constructor(root, view, kind) {
    this.root = root;
    this.view = view;
    this.kind = kind;
    this.known = "";
    this.ranged = "";
    /** What a surface gets that is to be Phong again. */
    this.lastExponent = FIRST_EXPONENT;
    this.#build();
    view.onChange(() => this.refresh());
  }

  /** The shapes to choose from. */
  get shapes() {
    return this.view.scene.shapes.filter(({ light }) => light === (this.kind === "light"));
  }

  /** The index of the chosen shape, or undefined where there is none. */
  get chosen() {
    const wanted = this.view.look[this.kind];
    const { shapes } = this;
    return (shapes.find(({ index }) => index === wanted) ?? shapes[0])?.index;
  }

  /** The chosen shape, as edited. */
  get shape() {
    return this.view.shape(this.chosen);
  }

  #build() {
    const id = `${this.kind}-choice`;
    this.select = make("select", { id, className: "wide" });
    this.select.addEventListener("change", () =>
      this.view.show({ [this.kind]: Number(this.select.value) }),
    );
    const label = make("label", { htmlFor: id }, this.kind === "light" ? "Light" : "Surface");
    const choice = make("div", { className: "field" }, label, this.select);
    this.note = make("p", { className: "note" });
    this.back = make("button", { type: "button", className: "quiet" }, `Reset ${this.kind}`);
    this.back.addEventListener("click", () => this.view.forget(this.chosen));
    this.material = this.#makeMaterial();
    this.swatch = make("span", { className: "swatch" });
    this.#makeFields();
    this.root.append(choice, this.note);
    this.root.append(this.radius.element, ...this.center.map((field) => field.element));
    this.root.append(...this.albedo.map((field) => field.element));
    this.root.append(this.material, this.exponent.element, this.back);
  }

  #makeFields() {
    const edit = (parts) => this.view.edit(this.chosen, parts);
    const component = (key, i) => ({
      read: () => this.shape[key]?.[i],
      write: (value) => edit({ [key]: this.shape[key].with(i, value) }),
    });
    const own = (key) => ({
      read: () => this.shape[key],
      write: (value) => edit({ [key]: value }),
    });
    this.radius = new NumberField({
      label: "Radius",
      range: [0.1, 1],
      logarithmic: true,
      ...own("radius"),
    });
    this.center = AXES.map(
      (label, i) => new NumberField({ label, range: [0, 1], ...component("center", i) }),
    );
    this.albedo = CHANNELS.map(
      (label, i) =>
        new NumberField({ label, range: [0, 1], step: 0.01, ...component("albedo", i) }),
    );
    this.exponent = new NumberField({
      label: "Exponent",
      range: EXPONENTS,
      logarithmic: true,
      ...own("exponent"),
    });
    this.fields = [this.radius, ...this.center, ...this.albedo, this.exponent];
  }

  #makeMaterial() {
    const radio = (label, exponent) => {
      const input = make("input", { type: "radio", name: `${this.kind}-material` });
      input.addEventListener("change", () =>
        this.view.edit(this.chosen, { exponent: exponent() }),
      );
      return make("label", {}, input, ` ${label}`);
    };
    const choices = [radio("diffuse", () => null), radio("Phong", () => this.lastExponent)];
    const legend = make("legend", {}, "Material");
    return make("fieldset", { className: "choices" }, legend, ...choices);
  }

  /** Show the chosen shape. */
  refresh() {
    if (!this.view.scene) return;
    this.#fillSelect();
    this.root.hidden = this.chosen === undefined;
    if (this.root.hidden) return;
    this.#setRanges();
    for (const field of this.fields) field.refresh();
    const { albedo, exponent, material, radiance } = this.shape;
    this.lastExponent = exponent ?? this.lastExponent;
    this.material.hidden = albedo == null;
    const [diffuse, phong] = this.material.querySelectorAll("input");
    [diffuse.checked, phong.checked] = [
      exponent == null && material !== "mirror",
      exponent != null,
    ];
    this.#describe(albedo, radiance);
    this.back.disabled = !this.view.state.edits[this.chosen];
  }

  #fillSelect() {
    const { shapes } = this;
    const text = JSON.stringify(shapes.map(({ index, kind, faces }) => [index, kind, faces]));
    if (text !== this.known) {
      this.known = text;
      const options = shapes.map((shape) => make("option", { value: shape.index }, nameOf(shape)));
      this.select.replaceChildren(...options);
    }
    this.select.value = String(this.chosen);
  }

  /** Fit the sliders of a sphere to it when it is chosen, or has left them. */
  #setRanges() {
    const { center, radius } = this.shape;
    const key = `${this.view.scene.scene} ${this.chosen}`;
    const inside = (field, value) => field.range[0] <= value && value <= field.range[1];
    const fits = () =>
      inside(this.radius, radius) && this.center.every((field, i) => inside(field, center[i]));
    if (!center || (key === this.ranged && fits())) return;
    this.ranged = key;
    this.radius.setRange(RADII.map((factor) => Number((factor * radius).toPrecision(2))));
    const { eye } = this.view.scene.camera;
    const reach = rounded(REACH * Math.hypot(...AXES.map((_, i) => center[i] - eye[i])));
    this.center.forEach((field, i) => {
      const middle = Math.round(center[i] / (reach / 100)) * (reach / 100);
      field.setRange([middle - reach, middle + reach], reach / 100);
    });
  }

  #describe(albedo, radiance) {
    const what = albedo ? ["albedo", albedo] : ["radiance", radiance];
    const largest = Math.max(1, ...what[1]);
    this.swatch.style.background = css(what[1].map((value) => value / largest));
    const numbers = what[1].map(short).join(", ");
    this.note.replaceChildren(this.swatch, ` ${what[0]} ${numbers}`);
  }
}

function nameOf({ index, kind, faces }) {
  return `${shapeName(index)} · ${kind === "mesh" ? `${faces} faces` : kind}`;
}

/** The next 1, 2, 2.5 or 5 times a power of ten. */
function rounded(value) {
  const unit = 10 ** Math.floor(Math.log10(value));
  return unit * [1, 2, 2.5, 5, 10].find((factor) => factor * unit >= value);
}
