// @ts-check
/** What is looked at: the state, asked of the server, and the look, which is the page's own. */

import { LOOK, limited } from "./url.js";

/** How near and how far the camera goes, in stops. */
const FARTHEST = 16;

export class View {
  /**
   * @param {any} state
   * @param {any} look
   */
  constructor(state, look) {
    this.state = state;
    this.look = look;
    /** The server's last message about the scene. */
    this.scene = null;
    /** @type {(() => void)[]} */
    this.listeners = [];
  }

  /** Call a listener after every change. */
  onChange(listener) {
    this.listeners.push(listener);
  }

  /** Replace everything. */
  replace(state, look = this.look) {
    this.state = state;
    this.look = look;
    this.changed();
  }

  /** Tell the listeners that something is new. */
  changed() {
    for (const listener of this.listeners) listener();
  }

  /** Change parts of the state. */
  change(parts) {
    this.replace({ ...this.state, ...parts });
  }

  /** Change parts of the look. */
  show(parts) {
    this.replace(this.state, limited({ ...this.look, ...parts }));
  }

  /** Change settings of one half. */
  changeHalf(index, parts) {
    const halves = this.state.halves.map((half, i) => (i === index ? { ...half, ...parts } : half));
    this.change({ halves });
  }

  /** Change the camera. */
  move(parts) {
    this.change({ camera: { ...this.state.camera, ...parts } });
  }

  /** Bring the camera nearer by some stops, as far as it goes. */
  zoomBy(stops) {
    const zoom = Math.round(100 * (this.state.camera.zoom + stops)) / 100;
    this.move({ zoom: Math.min(Math.max(zoom, -FARTHEST), FARTHEST) });
  }

  /** Show one half, or two that begin as the same. */
  compare(two) {
    const [half] = this.state.halves;
    const { difference } = this.state;
    this.change({
      halves: two ? [half, { ...half }] : [half],
      difference: !two && difference === "other" ? "none" : difference,
    });
  }

  /** Go to another scene, where edits, camera and pixel mean nothing. */
  changeScene(scene) {
    const camera = { azimuth: 0, elevation: 0, zoom: 0 };
    const { path, light, surface } = LOOK;
    const state = { ...this.state, scene, camera, edits: {}, pixel: null };
    this.replace(state, { ...this.look, path, light, surface });
  }

  /** A shape of the scene, as edited. */
  shape(index) {
    return { ...this.scene.shapes[index], ...this.state.edits[index] };
  }

  /** Change values of a shape. */
  edit(index, parts) {
    const { edits } = this.state;
    this.change({ edits: { ...edits, [index]: { ...edits[index], ...parts } } });
  }

  /** Take all changes of a shape back. */
  forget(index) {
    const { [index]: _, ...edits } = this.state.edits;
    this.change({ edits });
  }

  /** Pick a pixel, kept inside of the picture; or none. */
  pick(pixel) {
    const { width, height } = this.scene;
    const inside = (value, size) => Math.min(Math.max(value, 0), size - 1);
    const kept = pixel && [inside(pixel[0], width), inside(pixel[1], height)];
    this.replace({ ...this.state, pixel: kept }, { ...this.look, path: null });
  }

  /** The half that is shown at a pixel. */
  halfAt([column]) {
    const two = this.state.halves.length === 2;
    return two && column >= Math.round(this.look.divider * this.scene.width) ? 1 : 0;
  }
}
