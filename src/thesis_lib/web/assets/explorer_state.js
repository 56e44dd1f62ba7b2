// What the explorer shows, as a state: s structure, m mode, w [width, height] in px, f focal length, d distance and a
// amplitude in mm, r rest position, c [azimuth, elevation] of each camera in degrees, t the thesis's setup last chosen.
import model from "./explorer_model.js";
import simulation from "./simulation.js";

export default (() => {
  const FIRST = "4a-4", TRIALS = 100, { MOST, band, radians, shiftsOf } = simulation;
  const toward = (pair) => model.hemisphereDirection(...radians(pair)); // unit vector from the origin to a camera
  const apart = (one, two) => Math.hypot(...toward(one).map((c, i) => c - toward(two)[i]));
  const within = (value, [low, high]) => Math.max(low, Math.min(high, value));
  const sixteenToNine = (width) => [width, model.rint((width * 9) / 16)];

  // What is allowed, here and by `thesis run`: the structure is in front of the cameras, no two of which are in one place.
  const limits = ({ a }, { length, width }) =>
    ({ d: [Math.floor(500 * Math.hypot(length, width) + a) + 1, 10000], f: [1, 1000], a: [0.01, 100], w: [16, 8192] });
  const isLayout = (cameras) => cameras.length >= 2 && cameras.length <= MOST &&
    cameras.every(([azimuth, elevation]) => Math.abs(azimuth) <= 360 && elevation > 0 && elevation <= 90) &&
    cameras.every((one, i) => cameras.slice(0, i).every((two) => apart(one, two) > 1e-5));

  // Words for a value that is not allowed: what, given, allowed, and what stays.
  const refused = (what, given, [low, high], unit, stays) =>
    `${what}: ${given} is out of range, ${low} to ${high}${unit}; it stays ${stays}${unit}.`;

  function setupOf(state, { setups, reading }) { // the setup of the thesis that a state is, if it is one
    const fits = (one) => ["d", "w", "c"].every((key) => `${one[key]}` === `${state[key]}`);
    const same = Object.keys(reading).every((key) => state[key] === reading[key]) ? setups.filter(fits) : [];
    return same.find(({ id }) => id === state.t) ?? same[0];
  }

  // --- as text: ?s=beam&m=3&w=320&f=24&d=500&c=7,15;-7,15, and ?s=beam&m=1&t=4a-6 for a setup of the thesis
  const KEYS = ["s", "m", "t", "w", "f", "d", "a", "r", "c"];
  function fromAddress(query, structures, otherwise = "") { // what is unknown or makes no sense is as `otherwise` has it
    const given = new URLSearchParams(query), other = new URLSearchParams(otherwise);
    const told = (key, allowed) => [given, other].map((one) => one.get(key)).find((value) => allowed.includes(value));
    const number = (words) => (/^-?\d+(\.\d+)?$/.test(words) ? Math.round(1000 * words) / 1000 : NaN);
    const s = told("s", Object.keys(structures)) ?? "beam", { setups, reading } = structures[s];
    const named = (name) => setups.find(({ id }) => id === name?.replace("′", "'"));
    const { id: t, d, w, c } = named(given.get("t")) ?? named(other.get("t")) ?? named(FIRST);
    const state = { s, m: Number(told("m", ["1", "2", "3"]) ?? 1), d, w, c, ...reading, t };
    state.r = told("r", ["rebuilt", "known"]) ?? state.r;
    for (const key of ["a", "f", "d"]) {
      const value = number(given.get(key)), range = limits(state, structures[s])[key];
      state[key] = value === within(value, range) ? value : within(state[key], range);
    }
    const size = (given.get("w") ?? "").split("x").map(number), range = limits(state, structures[s]).w;
    if (size.length < 3 && size.every((n) => Number.isInteger(n) && n === within(n, range)))
      state.w = size.length === 2 ? size : sixteenToNine(size[0]);
    const cameras = (given.get("c") ?? "").split(";").map((pair) => pair.split(",").map(number));
    if (cameras.every((pair) => pair.length === 2 && pair.every(Number.isFinite)) && isLayout(cameras)) state.c = cameras;
    return state;
  }
  function toAddress(state, structure) {
    const { s, m, w, f, d, a, r, c } = state, { reading } = structure, setup = setupOf(state, structure);
    if (setup) return `s=${s}&m=${m}&t=${setup.id}`;
    const size = `${w}` === `${sixteenToNine(w[0])}` ? w[0] : w.join("x");
    const rare = (a === reading.a ? "" : `&a=${a}`) + (r === reading.r ? "" : `&r=${r}`);
    return `s=${s}&m=${m}&w=${size}&f=${f}&d=${d}${rare}&c=${c.join(";")}`;
  }
  function toCommand({ s, w, f, d, a, r, c }, { reading }) {
    const values = { cases: [], layouts: { mine: [c] }, distance_mm: d, resolution_px: w };
    if (f !== reading.f) values.focal_length_mm = f;
    if (a !== reading.a) values.amplitude_mm = a;
    if (r !== reading.r) values.rest = r;
    const words = Object.entries(values).map(([key, v]) => `${key}=${typeof v === "string" ? v : JSON.stringify(v)}`);
    return `thesis run ${s}-arrays ${words.map((one) => `-p ${/^[\w=.]+$/.test(one) ? one : `'${one}'`}`).join(" ")}`;
  }

  // What the cameras measure: the nominal run and the prediction, then one trial after the other.
  function compute({ m, w, f, d, a, r, c }, structure, sensorWidth) {
    const focal = (f * w[0]) / sensorWidth, setting = { distance: d, cameras: c, focal, size: w, known: r === "known" };
    const { P, rest, modes: [one], draw } = simulation.simulate(setting, structure, [{ mode: m, peak: a / 1000 }]);
    return { P, rest, ...one, groundSampleDistance: d / 1000 / focal, tryOne: draw };
  }

  return { KEYS, MOST, TRIALS, apart, band, compute, fromAddress, isLayout, limits, radians, refused, setupOf, shiftsOf, sixteenToNine,
    toAddress, toCommand, toward, within };
})();
