// @ts-check
/** The page: the parts, and what passes between them and the server. */

import { Asking } from "./asking.js";
import { Busy } from "./busy.js";
import { addOrbit } from "./camera.js";
import { Chart } from "./chart.js";
import { Connection } from "./connection.js";
import { addControls } from "./controls.js";
import { addDivider } from "./divider.js";
import { byId } from "./dom.js";
import { Inspector } from "./inspector.js";
import { drawScale, showLegend } from "./legend.js";
import { Picture, onTheme } from "./picture.js";
import { showReadouts } from "./readout.js";
import { ShapeEditor } from "./shape_editor.js";
import { addPictureKeys, addShortcuts } from "./shortcuts.js";
import { LOOK, read, write } from "./url.js";
import { View } from "./view.js";

/** How long the URL waits for the last change: browsers slow down pages that write it often. */
const URL_WAIT = 250;

class Page {
  constructor() {
    this.picture = new Picture(byId("canvas"));
    this.chart = new Chart(byId("chart"));
    this.busy = new Busy(byId("busy"));
    /** The header of the last frame of each half. */
    this.headers = [];
    /** Frames that the server has not been told to be drawn. */
    this.undrawn = 0;
    this.drawing = false;
    this.paused = false;
    drawScale();
    /** The number of the last view whose acceptance leaves the error on show where it is. */
    this.saidFor = 0;
    byId("alert-close").addEventListener("click", () => this.#say(""));
    this.connection = new Connection({
      message: (message) => this.take(message),
      binary: (header, buffer, start) => this.takeBinary(header, buffer, start),
      status: (state, text) => this.#showStatus(state, text),
    });
  }

  /** Take a message of text. */
  take(message) {
    if (message.type === "hello") this.#greeted(message);
    else if (message.type === "scene") this.#takeScene(message);
    else if (message.type === "pixel") this.inspector.take(message);
    else if (message.type === "refused") this.#refused(message);
    else if (message.type === "failed") this.#failed(message);
  }

  /** Take a frame or a file. */
  takeBinary(header, buffer, start) {
    if (header.type === "file") {
      download(header, buffer.slice(start));
      return;
    }
    this.undrawn++;
    if (header.half < this.view.state.halves.length) {
      this.headers[header.half] = header;
      this.picture.take(header, buffer, start);
      this.chart.add(header);
      this.busy.arrived(header.number);
      this.asking.arrived(header);
    }
    this.schedule();
  }

  #greeted(hello) {
    this.base = hello.state;
    if (!this.view) this.#start(hello);
    this.asking.again();
    if (this.paused) this.connection.send({ type: "pause", paused: true });
  }

  /** Build everything that shows or changes the view, which the URL tells. */
  #start(hello) {
    this.view = new View(hello.state, LOOK);
    this.asking = new Asking(this.view, this.connection, (number) => this.busy.wait(number));
    this.inspector = new Inspector(this.view);
    addControls(this.view, hello);
    new ShapeEditor(byId("light"), this.view, "light");
    new ShapeEditor(byId("surface"), this.view, "surface");
    addDivider(byId("divider"), this.view);
    this.#addPicture(byId("picture"));
    this.#addTools();
    this.view.onChange(() => this.schedule());
    this.view.onChange(() => this.#scheduleUrl());
    addEventListener("hashchange", () => this.#readUrl());
    onTheme(() => {
      this.picture.setTheme();
      drawScale();
      this.schedule();
    });
    this.#readUrl();
  }

  #addPicture(element) {
    const pick = (pixel) => this.inspector.pick(pixel);
    const orbited = addOrbit(element, this.view);
    addPictureKeys(element, this.view, pick);
    element.addEventListener("click", (event) => {
      if (!orbited() && this.view.scene) pick(this.#pixelAt(event));
    });
  }

  #pixelAt({ clientX, clientY }) {
    const { left, top, width, height } = this.picture.canvas.getBoundingClientRect();
    const { scene } = this.view;
    const column = ((clientX - left) / width) * scene.width;
    const row = ((clientY - top) / height) * scene.height;
    return /** @type {[number, number]} */ ([Math.floor(column), Math.floor(row)]);
  }

  #addTools() {
    const pause = () => this.#pause(!this.paused);
    const restart = () => this.asking.restart();
    byId("pause").addEventListener("click", pause);
    byId("restart").addEventListener("click", restart);
    byId("reset").addEventListener("click", () => this.view.replace(this.base, LOOK));
    byId("copy").addEventListener("click", () => this.#copyLink());
    byId("copy").hidden = !navigator.clipboard; // as it is where the page is not from this machine
    addShortcuts(this.view, { pause, restart });
    for (const button of document.querySelectorAll("[data-save]")) {
      button.addEventListener("click", () => this.#save(button.getAttribute("data-save")));
    }
  }

  #pause(paused) {
    this.paused = paused;
    this.connection.send({ type: "pause", paused });
    byId("pause").textContent = paused ? "Go on" : "Pause";
  }

  #save(what) {
    if (!this.connection.isOpen) {
      this.#say("The server is gone: what it has rendered cannot be saved.");
      return;
    }
    const half = this.view.state.halves.length === 2 ? Number(byId("save-half").value) : 0;
    this.connection.send({ type: "save", what, half, exposure: this.view.look.exposure });
  }

  async #copyLink() {
    this.#writeUrl();
    await navigator.clipboard.writeText(location.href);
    byId("copy").textContent = "Copied";
    setTimeout(() => (byId("copy").textContent = "Copy link"), 2000);
  }

  #takeScene(message) {
    this.asking.accept(message.number);
    this.view.scene = { ...this.view.scene, ...message }; // without shapes, they are as before
    byId("picture").style.setProperty("--aspect", String(message.width / message.height));
    if (message.number > this.saidFor) this.#say("");
    this.view.changed();
  }

  #refused({ number, message }) {
    this.busy.end();
    const state = this.asking.refuse(number);
    if (state) this.view.replace(state);
    else if (!this.asking.accepted) this.view.replace(this.base);
    this.#say(message, state || this.asking.accepted ? 0 : 1);
  }

  #failed({ message }) {
    this.busy.end();
    this.#say(message);
  }

  /**
   * Show an error, or nothing.
   * @param {string} text
   * @param {number} more how many views the page asks for by itself before the error is outdated
   */
  #say(text, more = 0) {
    this.saidFor = (this.asking?.number ?? 0) + more;
    byId("alert-text").textContent = text;
    byId("alert").hidden = !text;
  }

  #showStatus(state, text) {
    const element = byId("connection");
    element.textContent = text;
    element.dataset.state = state;
    if (state !== "open") this.busy.end();
  }

  /** Draw in the next animation frame, and tell the server which frames that were. */
  schedule() {
    if (this.drawing) return;
    this.drawing = true;
    requestAnimationFrame(() => {
      this.drawing = false;
      this.#draw();
      for (; this.undrawn > 0; this.undrawn--) this.connection.send({ type: "drawn" });
    });
  }

  #draw() {
    const { state, look } = this.view;
    const { length } = state.halves;
    this.headers.length = Math.min(this.headers.length, length);
    this.picture.draw(look, length);
    this.chart.draw(length);
    showReadouts(state, this.headers);
    showLegend(state.difference, look.scale, this.headers);
    this.inspector.showValues(this.headers);
    byId("save-half").hidden = length < 2;
  }

  #scheduleUrl() {
    clearTimeout(this.urlTimer);
    this.urlTimer = setTimeout(() => this.#writeUrl(), URL_WAIT);
  }

  #writeUrl() {
    if (location.hash !== this.readHash) return; // the user changed it, and it is read next
    const hash = `#${write(this.view.state, this.view.look, this.base)}`;
    if (hash !== location.hash) history.replaceState(null, "", hash);
    this.readHash = location.hash;
  }

  #readUrl() {
    this.readHash = location.hash;
    const { state, look, ignored } = read(location.hash, this.base);
    this.#say(ignored.length ? `The link holds what means nothing: ${ignored.join(", ")}` : "", 1);
    this.view.replace(state, look);
  }
}

function download({ name, media }, bytes) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes], { type: media }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

new Page();
