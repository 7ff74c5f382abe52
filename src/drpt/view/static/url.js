// @ts-check
/** The state and the look as the hash of the URL, which a link reproduces. */

import { SIDES } from "./format.js";

/** What the picture is shown with; the server never hears of it. */
export const LOOK = {
  exposure: 0, // stops
  scale: 0.5, // the difference that has the last colour
  divider: 0.5, // from the left, as a part of the width
  draw: true, // whether the paths are drawn
  path: null, // the chosen one; null: the brightest
  light: null, // chosen for the controls; null: the first
  surface: null,
};

const LIMITS = { exposure: [-100, 100], scale: [1e-6, 1e6], divider: [0, 1] };

/** Keys whose values are numbers, by where they stand. */
const NUMBERS = { state: ["spp", "seed", "paths"], look: ["exposure", "scale", "divider"] };
const CHOICES = ["path", "light", "surface"];
const CAMERA = ["azimuth", "elevation", "zoom"];
const EDIT = /^shape(\d+)\.(radius|center|albedo|exponent)$/;

/** Return a look within its limits. */
export function limited(look) {
  const inside = Object.entries(LIMITS).map(([key, [min, max]]) => [
    key,
    Math.min(Math.max(look[key], min), max),
  ]);
  const chosen = CHOICES.map((key) => [key, look[key] !== null && look[key] >= 0 ? Math.floor(look[key]) : null]);
  return { ...look, ...Object.fromEntries(inside), ...Object.fromEntries(chosen) };
}

/**
 * Write a state and a look as `key=value` pairs: the scene, and what differs from the default.
 * @param {any} state
 * @param {any} look
 * @param {any} base the default state
 */
export function write(state, look, base) {
  const pairs = [["scene", state.scene]];
  const add = (key, value, other) => String(value) === String(other) || pairs.push([key, value]);
  SIDES.forEach((side, i) => add(side, half(state.halves[i]), half(base.halves[i])));
  for (const key of [...NUMBERS.state, "difference"]) add(key, state[key], base[key]);
  for (const key of CAMERA) add(key, state.camera[key], base.camera[key]);
  for (const [index, edit] of Object.entries(state.edits)) {
    for (const [key, value] of Object.entries(edit)) pairs.push([`shape${index}.${key}`, value]);
  }
  add("pixel", state.pixel, base.pixel);
  for (const key of [...NUMBERS.look, ...CHOICES, "draw"]) add(key, look[key], LOOK[key]);
  return pairs.map(([key, value]) => `${key}=${escaped(String(value))}`).join("&");
}

function half(settings) {
  return settings ? [settings.mode, settings.sampler, settings.bounces] : "none";
}

function escaped(text) {
  return encodeURIComponent(text).replaceAll("%2C", ",").replaceAll("%2F", "/");
}

/**
 * Read what `write` has written.
 * @param {string} hash
 * @param {any} base the default state
 * @returns {{ state: any, look: any, ignored: string[] }} `ignored`: pairs that say nothing
 */
export function read(hash, base) {
  const view = { state: structuredClone(base), look: { ...LOOK } };
  const ignored = [];
  for (const [key, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    if (!take(view, key, text)) ignored.push(`${key}=${text}`);
  }
  return { state: view.state, look: limited(view.look), ignored };
}

/** Set what a pair says and return true; or return false. Ranges are judged by the server. */
function take({ state, look }, key, text) {
  const edit = EDIT.exec(key);
  if (edit) return takeEdit(state.edits, edit[1], edit[2], text);
  if (SIDES.includes(key)) return takeHalf(state.halves, SIDES.indexOf(key), text);
  if (key === "scene" || key === "difference") state[key] = text;
  else if (key === "draw") look.draw = text !== "false";
  else if (key === "pixel") return set(state, key, numbers(text, 2));
  else if (CAMERA.includes(key)) return set(state.camera, key, numbers(text, 1)?.[0]);
  else if (NUMBERS.state.includes(key)) return set(state, key, numbers(text, 1)?.[0]);
  else if (Object.hasOwn(LOOK, key)) return set(look, key, numbers(text, 1)?.[0]);
  else return false;
  return true;
}

function takeHalf(halves, index, text) {
  if (text === "none") return halves.splice(index).length > 0;
  const [mode, sampler, bounces] = text.split(",");
  const count = numbers(bounces ?? "", 1)?.[0];
  if (count === undefined || index > halves.length) return false;
  halves[index] = { mode, sampler, bounces: count };
  return true;
}

function takeEdit(edits, index, key, text) {
  const edit = edits[index] ?? {};
  const triple = key === "center" || key === "albedo";
  const values = numbers(text, triple ? 3 : 1);
  const diffuse = key === "exponent" && text === "null";
  if (!set(edit, key, diffuse ? null : triple ? values : values?.[0])) return false;
  edits[index] = edit;
  return true;
}

function set(target, key, value) {
  if (value === undefined) return false;
  target[key] = value;
  return true;
}

/** Read numbers with commas between them; undefined if they are not that many. */
function numbers(text, count) {
  const parts = text.split(",").map((part) => (part.trim() ? Number(part) : NaN));
  return parts.length === count && parts.every(Number.isFinite) ? parts : undefined;
}
