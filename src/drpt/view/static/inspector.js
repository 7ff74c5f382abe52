// @ts-check
/** The picked pixel: its value, and the paths through it in numbers and over the picture. */

import { css } from "./colours.js";
import { byId, make } from "./dom.js";
import { SIDES, shapeName, short } from "./format.js";
import { addFields } from "./number_field.js";
import { drawOverlay } from "./overlay.js";

/** No paths. */
const NONE = [];
/** What stands for a colour that is not finite. */
const UNKNOWN = [NaN, NaN, NaN];

const CHANNELS = ["red", "green", "blue"];

export class Inspector {
  /** @param {import("./view.js").View} view */
  constructor(view) {
    this.view = view;
    /** @type {any[]} the last message about the pixel, by half */
    this.messages = [];
    /** Whether the next message chooses the surface for the controls. */
    this.picking = false;
    this.canvas = byId("canvas");
    this.#addControls();
    new ResizeObserver(() => this.#drawOverlay()).observe(this.canvas);
    view.onChange(() => this.refresh());
  }

  #addControls() {
    const { view } = this;
    byId("clear-pixel").addEventListener("click", () => view.pick(null));
    byId("show-paths").addEventListener("change", (event) =>
      view.show({ draw: event.target.checked }),
    );
    const write = (paths) => view.change({ paths });
    const count = { label: "How many", read: () => view.state.paths, write };
    this.refreshFields = addFields(byId("paths-fields"), [count]);
  }

  /** Pick a pixel, and the surface that is seen in it. */
  pick(pixel) {
    this.picking = true;
    this.view.pick(pixel);
  }

  /** Take a message about the picked pixel. */
  take(message) {
    this.messages[message.half] = message;
    const { surface } = message;
    if (!this.picking || !this.#isCurrent(message)) return this.refresh();
    this.picking = false;
    if (surface === null) return this.refresh();
    this.view.show({ [this.view.scene.shapes[surface].light ? "light" : "surface"]: surface });
  }

  /** Whether a message, or what a frame says of its pixel, is about the picked one. */
  #isCurrent(message) {
    const { pixel } = this.view.state;
    return pixel && message?.column === pixel[0] && message.row === pixel[1];
  }

  /** The paths of the half that is shown at the pixel. */
  get paths() {
    const { pixel } = this.view.state;
    const message = pixel && this.messages[this.view.halfAt(pixel)];
    return this.#isCurrent(message) ? message.paths : NONE;
  }

  /** The index of the chosen path: the brightest, if none was chosen. */
  get chosen() {
    const { path } = this.view.look;
    if (path !== null && path < this.paths.length) return path;
    const sums = this.paths.map(({ radiance }) => (radiance ? sum(radiance) : Infinity));
    return sums.indexOf(Math.max(...sums));
  }

  /** Show everything but the running mean. */
  refresh() {
    const { pixel } = this.view.state;
    if (!this.view.scene) return;
    byId("pixel").hidden = !pixel;
    byId("pixel-hint").hidden = Boolean(pixel);
    byId("show-paths").checked = this.view.look.draw;
    this.refreshFields();
    if (pixel) this.#showPlace(pixel);
    this.#showList();
    this.#showTable();
    this.#drawOverlay();
  }

  #showPlace([column, row]) {
    const message = this.messages.find((one) => this.#isCurrent(one));
    const met = message && (message.surface === null ? "background" : shapeName(message.surface));
    byId("pixel-place").textContent = `column ${column}, row ${row}${met ? `: ${met}` : ""}`;
  }

  /** Show the running means that came with the last frames. */
  showValues(headers) {
    const { pixel, halves } = this.view.state;
    if (!pixel) return;
    const values = halves.map((_, half) => headers[half]?.pixel);
    const names = halves.length === 2 ? SIDES : ["radiance"];
    const heads = names.map((name) => make("th", { scope: "col", className: name }, name));
    const rows = CHANNELS.map((channel, c) =>
      make(
        "tr",
        {},
        make("th", { scope: "row" }, channel),
        ...values.map((value) => make("td", {}, this.#isCurrent(value) ? cell(value, c) : "–")),
      ),
    );
    byId("pixel-values").replaceChildren(
      make("caption", {}, "Mean ± standard error"),
      make("thead", {}, make("tr", {}, make("td"), ...heads)),
      make("tbody", {}, ...rows),
    );
  }

  #showList() {
    const { paths, chosen } = this;
    const { exposure } = this.view.look;
    const list = byId("path-list");
    if (this.listed?.paths !== paths || this.listed.exposure !== exposure) {
      this.listed = { paths, exposure };
      const focused = list.contains(document.activeElement);
      list.replaceChildren(...paths.map((path, i) => this.#makeChoice(path, i, exposure)));
      if (focused) list.querySelectorAll("input")[chosen]?.focus();
    }
    list.querySelectorAll("input").forEach((input, i) => (input.checked = i === chosen));
  }

  #makeChoice({ sample, radiance }, index, exposure) {
    const name = `path ${sample}, radiance ${(radiance ?? UNKNOWN).map(short).join(", ")}`;
    const input = make("input", { type: "radio", name: "path", "aria-label": name });
    input.addEventListener("change", () => this.view.show({ path: index }));
    const swatch = make("span", { className: "swatch" });
    swatch.style.background = css(radiance ?? UNKNOWN, exposure);
    return make("label", { title: name }, input, swatch);
  }

  #showTable() {
    const path = this.paths[this.chosen];
    const table = byId("path-table");
    table.hidden = !path;
    if (!path) return;
    const { exposure } = this.view.look;
    const heads = ["", "met", "throughput", "adds"].map((name) =>
      make("th", { scope: "col" }, name),
    );
    const rows = path.vertices.map((vertex, i) => vertexRow(vertex, i, exposure));
    const total = make(
      "tr",
      { className: "total" },
      make("th", { scope: "row", colSpan: 3 }, "radiance of the path"),
      triple(path.radiance, exposure),
    );
    table.replaceChildren(
      make("caption", {}, `Vertices of path ${path.sample}`),
      make("thead", {}, make("tr", {}, ...heads)),
      make("tbody", {}, ...rows, total),
    );
  }

  #drawOverlay() {
    if (!this.view.scene) return;
    const { state, look } = this.view;
    drawOverlay(byId("overlay"), {
      pixel: state.pixel,
      paths: look.draw ? this.paths : [],
      chosen: this.chosen,
      scale: this.canvas.clientWidth / this.view.scene.width,
      choose: (path) => this.view.show({ path }),
    });
  }
}

function sum(values) {
  return values.reduce((total, value) => total + value, 0);
}

function cell({ mean, standard_error: error }, channel) {
  return error ? `${short(mean[channel])} ± ${short(error[channel])}` : short(mean[channel]);
}

function vertexRow({ event, shape, throughput, contribution, light }, index, exposure) {
  const lit = light ? (light.visible ? "light seen" : "light hidden") : "";
  const what = shape === null ? event : `${event} ${shapeName(shape)}`;
  return make(
    "tr",
    {},
    make("th", { scope: "row" }, String(index + 1)),
    make("td", { className: "met" }, make("span", {}, what), make("small", {}, lit)),
    triple(throughput, 0),
    triple(contribution, exposure),
  );
}

/** Three numbers, one below the other, beside their colour. */
function triple(rgb, exposure) {
  const swatch = make("span", { className: "swatch" });
  swatch.style.background = css(rgb ?? UNKNOWN, exposure);
  const numbers = (rgb ?? UNKNOWN).map((value) => make("span", {}, short(value)));
  return make("td", {}, make("div", { className: "triple" }, swatch, make("div", {}, ...numbers)));
}
