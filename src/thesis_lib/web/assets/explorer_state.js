// What the explorer shows, as a state: s structure, m mode, w [width, height] in px, f focal
// length, d distance and a amplitude in mm, r rest position, c [azimuth, elevation] of each camera in
// degrees, t the thesis's setup last chosen.
import { clamp } from "./parts.js";
import { rint } from "./pinhole.js";
import { MOST_CAMERAS, simulateSetting, towards } from "./physics.js";

export const TRIALS = 100;
export const STATE_KEYS = ["s", "m", "t", "w", "f", "d", "a", "r", "c"];
const FIRST_SETUP = "4a-4";
export const apart = (one, two) =>
  Math.hypot(...towards(one).map((c, i) => c - towards(two)[i]));
export const sixteenToNine = (width) => [width, rint((width * 9) / 16)];

// What is allowed, here and by `thesis run`: the structure is in front of the cameras, no two of
// which are in one place.
export const limits = ({ a }, { length, width }) => ({
  d: [Math.floor(500 * Math.hypot(length, width) + a) + 1, 10000],
  f: [1, 1000], a: [0.01, 100], w: [16, 8192],
});
export const isLayout = (cameras) => cameras.length >= 2 && cameras.length <= MOST_CAMERAS &&
  cameras.every(([azimuth, elevation], i) =>
    Math.abs(azimuth) <= 360 && elevation > 0 && elevation <= 90 &&
    cameras.slice(0, i).every((other) => apart(cameras[i], other) > 1e-5));

// Words for a value that is not allowed: what, given, allowed, and what stays.
export const refused = (what, given, [low, high], unit, stays) =>
  `${what}: ${given} is out of range, ${low} to ${high}${unit}; it stays ${stays}${unit}.`;

export function setupOf(state, { setups, reading }) { // the thesis's setup that a state is, if any
  const known = Object.keys(reading).every((key) => state[key] === reading[key]);
  const same = setups.filter((one) => known &&
    ["d", "w", "c"].every((key) => `${one[key]}` === `${state[key]}`));
  return same.find(({ id }) => id === state.t) ?? same[0];
}

// --- as text: ?s=beam&m=3&w=320&f=24&d=500&c=7,15;-7,15, and ?s=beam&m=1&t=4a-6 for a setup of the
// thesis; what is unknown or makes no sense is as `otherwise` has it
export function fromAddress(query, structures, otherwise = "") {
  const given = new URLSearchParams(query), other = new URLSearchParams(otherwise);
  const asked = (key, allowed) =>
    [given, other].map((one) => one.get(key)).find((value) => allowed.includes(value));
  const number = (words) =>
    (/^-?\d+(\.\d+)?$/.test(words) ? Math.round(1000 * words) / 1000 : NaN);
  const s = asked("s", Object.keys(structures)) ?? "beam", { setups, reading } = structures[s];
  const named = (name) => setups.find(({ id }) => id === name?.replace("′", "'"));
  const { id: t, d, w, c } = named(given.get("t")) ?? named(other.get("t")) ?? named(FIRST_SETUP);
  const state = { s, m: Number(asked("m", ["1", "2", "3"]) ?? 1), d, w, c, ...reading, t };
  state.r = asked("r", ["rebuilt", "known"]) ?? state.r;
  for (const key of ["a", "f", "d"]) {
    const value = number(given.get(key)), range = limits(state, structures[s])[key];
    state[key] = value === clamp(value, range) ? value : clamp(state[key], range);
  }
  const size = (given.get("w") ?? "").split("x").map(number);
  const range = limits(state, structures[s]).w;
  if (size.length < 3 && size.every((n) => Number.isInteger(n) && n === clamp(n, range)))
    state.w = size.length === 2 ? size : sixteenToNine(size[0]);
  const cameras = (given.get("c") ?? "").split(";").map((pair) => pair.split(",").map(number));
  const pairs = cameras.every((pair) => pair.length === 2 && pair.every(Number.isFinite));
  if (pairs && isLayout(cameras)) state.c = cameras;
  return state;
}
export function toAddress(state, structure) {
  const { s, m, w, f, d, a, r, c } = state, { reading } = structure;
  const setup = setupOf(state, structure);
  if (setup) return `s=${s}&m=${m}&t=${setup.id}`;
  const size = `${w}` === `${sixteenToNine(w[0])}` ? w[0] : w.join("x");
  const rare = (a === reading.a ? "" : `&a=${a}`) + (r === reading.r ? "" : `&r=${r}`);
  return `s=${s}&m=${m}&w=${size}&f=${f}&d=${d}${rare}&c=${c.join(";")}`;
}
export function toCommand({ s, w, f, d, a, r, c }, { reading }) {
  const values = { cases: [], layouts: { mine: [c] }, distance_mm: d, resolution_px: w };
  if (f !== reading.f) values.focal_length_mm = f;
  if (a !== reading.a) values.amplitude_mm = a;
  if (r !== reading.r) values.rest = r;
  const words = Object.entries(values).map(([key, value]) =>
    `${key}=${typeof value === "string" ? value : JSON.stringify(value)}`);
  const quoted = words.map((one) => `-p ${/^[\w=.]+$/.test(one) ? one : `'${one}'`}`);
  return `thesis run ${s}-arrays ${quoted.join(" ")}`;
}

// What the cameras measure: the nominal run and the prediction, then one trial after the other.
export function compute({ m, w, f, d, a, r, c }, structure, sensorWidth) {
  const focal = (f * w[0]) / sensorWidth;
  const setting = { distance: d, cameras: c, focal, size: w, known: r === "known" };
  const shapes = [{ mode: m, peak: a / 1000 }];
  const { P, rest, modes: [one], draw } = simulateSetting(setting, structure, shapes);
  return { P, rest, ...one, groundSampleDistance: d / 1000 / focal, tryOne: draw };
}
