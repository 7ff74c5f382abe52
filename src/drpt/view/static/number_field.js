// @ts-check
/** A number that is set by a slider or typed. */

import { make } from "./dom.js";

const POSITIONS = 400;
let made = 0;

/**
 * @typedef {object} Settings
 * @property {string} label
 * @property {() => number | null | undefined} read
 * @property {(value: number) => void} write
 * @property {[number, number]} [range] of the slider; without it there is none
 * @property {number} [step] of the slider
 * @property {boolean} [logarithmic] whether the slider's positions are those of the logarithm
 * @property {boolean} [whole] whether the slider knows whole numbers alone
 * @property {string} [unit]
 */

export class NumberField {
  /** @param {Settings} settings */
  constructor(settings) {
    this.settings = settings;
    const { label, unit } = settings;
    const id = `number-${++made}`;
    this.number = make("input", { type: "number", step: "any", id });
    this.number.addEventListener("input", () => (this.typing = true));
    this.number.addEventListener("change", () => this.#typed());
    this.slider = settings.range && this.#makeSlider(`${label}, slider`);
    const name = make("label", { htmlFor: id }, label);
    if (unit) name.append(make("span", { className: "unit" }, ` ${unit}`));
    this.element = make("div", { className: "field" }, name, ...this.#inputs());
    this.setRange(settings.range ?? [0, 1], settings.step);
  }

  #inputs() {
    return this.slider ? [this.slider, this.number] : [this.number];
  }

  #makeSlider(name) {
    const slider = make("input", { type: "range", "aria-label": name });
    slider.addEventListener("input", () => {
      this.typing = false;
      this.settings.write(this.#valueAt(slider.valueAsNumber));
    });
    return slider;
  }

  /** Let the slider reach from one value to another. */
  setRange(range, step = (range[1] - range[0]) / POSITIONS) {
    this.range = range;
    if (!this.slider) return;
    const [min, max] = this.settings.logarithmic ? [0, POSITIONS] : range;
    Object.assign(this.slider, { min, max, step: this.settings.logarithmic ? 1 : step });
  }

  /** Show the value, unless another one is being typed. */
  refresh() {
    const value = this.settings.read();
    this.element.hidden = value == null;
    if (value == null) return;
    if (!this.typing) this.number.value = String(Number.isInteger(value) ? value : digits(value, 6));
    if (!this.slider) return;
    this.slider.value = String(this.#positionOf(value));
    this.slider.setAttribute("aria-valuetext", this.number.value);
  }

  #typed() {
    if (!this.typing) return; // the slider was faster
    this.typing = false;
    const value = this.number.valueAsNumber;
    if (Number.isFinite(value)) this.settings.write(value);
    else this.refresh();
  }

  #valueAt(position) {
    if (!this.settings.logarithmic) return digits(position, 6);
    const [min, max] = this.range;
    const value = digits(min * (max / min) ** (position / POSITIONS), 3);
    const inside = Math.min(Math.max(value, min), max);
    return this.settings.whole ? this.#wholeNear(inside, position) : inside;
  }

  /** The whole number near a value, another one than before where the slider was moved. */
  #wholeNear(value, position) {
    const before = /** @type {number} */ (this.settings.read());
    const way = Math.sign(position - this.#positionOf(before));
    return Math.round(value) === before ? before + way : Math.round(value);
  }

  #positionOf(value) {
    if (!this.settings.logarithmic) return value;
    const [min, max] = this.range;
    return Math.round((POSITIONS * Math.log(value / min)) / Math.log(max / min));
  }
}

function digits(value, count) {
  return Number(value.toPrecision(count));
}

/** Put fields into an element and return a function that refreshes all of them. */
export function addFields(parent, settings) {
  const fields = settings.map((one) => new NumberField(one));
  parent.append(...fields.map((field) => field.element));
  return () => fields.forEach((field) => field.refresh());
}
