// A request of chapter 3 or 4 computed in the page: its settings, as in facts/setups.py, refusals
// beyond bounds, in the words of figure_sets/parametric, and the viewer's data from the results of
// a worker. Values are as in request.js: whole numbers are BigInt, objects are Maps.
import { isNumber, show } from "./parts.js";
import { MOST_CAMERAS } from "./physics.js";
import { apart, rint } from "./pinhole.js";
import source from "./recompute_worker.js";
import { formatGeneral, formatGiven } from "./request.js";

const DRAWS = 200;
const MOST_IMAGES = 1e6; // of markers, in a page

// --- settings, by what is varied; `facts` are the thesis's
const pairOf = ({ azimuth_deg: azimuth, elevation_deg: elevation }) =>
  [[azimuth, elevation], [-azimuth, elevation]];
const SETTINGS = {
  distance: (v) => v.distances_mm.map((distance) => ({
    case: "1", value: distance, label: `${formatGeneral(distance)} mm`, distance,
    cameras: pairOf(v),
  })),
  aperture: (v, { centres, opposite }) => v.cases.flatMap((name) => {
    const opened = name in centres
      ? v.half_apertures_deg.map((half) => [2 * half, [centres[name] + half, v.elevation_deg],
        [centres[name] - half, v.elevation_deg]])
      : v.elevations_deg.map((elevation) => [180 - 2 * elevation,
        ...opposite[name].map((azimuth) => [azimuth, elevation])]);
    return opened.map(([alpha, ...cameras]) =>
      ({ case: name, value: alpha, label: `${formatGeneral(alpha)}°`, cameras }));
  }),
  resolution: (v) => v.widths_px.map(Number).map((width) => {
    const size = [width, rint((width * 9) / 16)];
    return { case: "3", value: width, label: size.join("×"), cameras: pairOf(v), size };
  }),
  arrays: (v, { pairs, order: usual }) => {
    const grown = v.cases.map((name) => {
      const order = v.pair_order.get(name) ?? usual[name] ?? "printed";
      const ordered = order === "reversed" ? pairs[name].toReversed() : pairs[name];
      return [name, order, ordered.map((_, n) => ordered.slice(0, n + 1).flat())];
    });
    const own = [...v.layouts].map(([name, sets]) => [name, "", sets]);
    return [...grown, ...own].flatMap(([name, order, sets]) => sets.map((cameras) => ({
      case: name, value: cameras.length, label: `${cameras.length} cameras`, cameras, order,
    })));
  },
};
function peaksOf({ amplitude_mm: given, modes }, { peaks }) { // in m
  if (given === "force") return modes.map((mode) => Number(peaks[Number(mode) - 1]));
  return modes.map((_, i) => (Array.isArray(given) ? given[i] : given) / 1000);
}

// --- refusals
function findCoincident({ cameras }) { // the first two cameras in one place
  const pairs = cameras.flatMap((one, i) => cameras.slice(i + 1).map((two) => [one, two]));
  return pairs.find(([one, two]) => apart(one, two) < 1e-6);
}
function findProblem(values, settings, peaks, facts, { length, width }) {
  const { opposite, pairs, conditions } = facts;
  const { layouts, cases, amplitude_mm: amplitude } = values;
  const refuse = (field, given, why) => `${field}: given ${formatGiven(given)}, ${why}`;
  const uneven = Array.isArray(amplitude) && amplitude.length !== peaks.length;
  if (uneven || peaks.some(Number.isNaN))
    return refuse("amplitude_mm", amplitude, conditions.amplitude_mm);
  const reach = 1000 * (Math.hypot(length, width) / 2 + Math.max(...peaks));
  const near = settings.find((one) => one.distance <= reach);
  if (near) return refuse("distances_mm" in values ? "distances_mm" : "distance_mm", near.distance,
    conditions.reach.replace("{}", formatGeneral(reach, 4)));
  for (const one of settings) {
    const same = findCoincident(one);
    if (!same) continue;
    const field = layouts?.has(one.case) ? "layouts" : same[0][1] < 90 ? "azimuth_deg"
      : one.case in opposite ? "elevations_deg" : "elevation_deg";
    const place = [formatGiven(one.case), one.label];
    return refuse(field, same,
      place.reduce((text, part) => text.replace("{}", () => part), conditions.places));
  }
  if (!layouts) return "";
  if (!cases.length && !layouts.size) return refuse("cases", cases, conditions.cases);
  const grow = [...layouts.values()]
    .every((sets) => sets.every((one, i) => !i || sets[i - 1].length < one.length));
  const own = [...layouts.keys()].every((name) => !Object.hasOwn(pairs, name));
  return grow && own ? "" : refuse("layouts", layouts, conditions.layouts);
}
function findLimit({ estimator, noise_px: noise, modes }, settings, markers) { // of a page, or ""
  if (estimator !== "least-squares") return `the estimator ${estimator}`;
  if (noise > 0) return "noise in the images";
  const counts = settings.map((one) => one.cameras.length), most = Math.max(...counts);
  if (most > MOST_CAMERAS) return `${most} cameras (a page takes ${MOST_CAMERAS})`;
  const images = counts.reduce((sum, count) => sum + count, 0) * (modes.length + 1) * markers;
  return images > MOST_IMAGES ? `${images} images of markers (a page takes ${MOST_IMAGES})` : "";
}

// Settings, modes with their peaks and the structure of a request, or a `problem`, or why it is
// `left` to the command.
function planRequest({ subject, study }, values, facts) {
  const given = facts.structures[subject], peaks = peaksOf(values, given);
  const common = { distance: values.distance_mm, size: values.resolution_px?.map(Number) };
  const settings = SETTINGS[study](values, facts).map((one) => ({ ...common, ...one }));
  const problem = findProblem(values, settings, peaks, facts, given);
  if (problem) return { problem };
  const structure = given.row
    ? { ...given, row: { ...given.row, first: values.first_marker_mm / 1000 } }
    : { ...given, grid: values.grid.map(Number) };
  const [nx, ny] = structure.grid ?? [given.row.count, 1];
  const left = findLimit(values, settings, nx * ny);
  if (left) return { left };
  const turn = ([azimuth, elevation]) => [90 - azimuth, elevation];
  return {
    settings: settings.map((one) => ({ ...one,
      cameras: values.azimuth_zero === "X" ? one.cameras.map(turn) : one.cameras,
      focal: (values.focal_length_mm * one.size[0]) / values.sensor_width_mm,
      known: values.rest === "known", offset: values.principal_offset_px })),
    structure, shapes: values.modes.map((mode, i) => ({ mode: Number(mode), peak: peaks[i] })),
  };
}

// --- results
const toMm = (values) => Array.from(values, (value) => 1000 * value);

// What the viewer draws, before the draws. `facts` are those of figure_sets/parametric/in_page.py.
function describeResults(set, plan, found, values, facts) {
  const { settings, structure, shapes } = plan, { grid, hertz, length, width } = structure;
  const [x, y] = found.markers.map((axis) => toMm(axis).map((v) => Math.round(1e3 * v) / 1e3));
  const known = new Map(set.published.map(([name, value, order, mode, ...statistics]) =>
    [[name, value, order, mode].join(), statistics]));
  const all = settings.map((one, i) => ({
    label: one.label, value: one.value, resolution: one.size, in_view: found.settings[i].inView,
    cameras: one.cameras.map((direction) => [one.distance, ...direction]),
    modes: found.settings[i].modes.map(({ measured, errors, predicted }, m) => {
      const before = known.get([one.case, one.value, one.order ?? "", shapes[m].mode].join());
      const [mean, median, low, high] = before ?? [];
      return { measured_mm: toMm(measured), point_error: errors.point, mean: errors.mean,
        largest: errors.largest, predicted, stated: null,
        published: before && { mean, median, low, high } };
    }),
  }));
  const ownPair = "azimuth_deg" in values && `a pair at ±${formatGeneral(values.azimuth_deg)}°`;
  return {
    structure: { kind: set.subject, length_mm: 1000 * length, width_mm: 1000 * width },
    parameter: set.parameter, colors: facts.colors,
    words: { draws: `${DRAWS} pixel grids`, predicts: "law of rounding" },
    ...(grid ? { colormap: facts.colormap, grid, x_mm: x.slice(0, grid[0]),
      y_mm: y.filter((_, n) => n % grid[0] === 0) } : { x_mm: x }),
    lens: Object.fromEntries(facts.lens.map((name) => [name, values[name]])), all,
    modes: shapes.map(({ mode }, m) => ({ mode, frequency_hz: hertz[mode - 1],
      reference_mm: toMm(found.settings[0].modes[m].reference) })),
    cases: [...new Set(settings.map((one) => one.case))].map((name) => ({
      name, title: ownPair || (set.titles[name] ?? "own layout"), figures: {},
      settings: all.filter((_, i) => settings[i].case === name),
    })),
  };
}

// A sentence that compares the errors with the published ones, and warns of markers out of view.
function compareResults({ all }) {
  const every = all.flatMap((one) => one.modes), done = every.every((one) => isNumber(one.median));
  const of = (one) => (done ? one.median : one.mean), rise = (a, b) => a - b;
  const which = done ? `median error over ${DRAWS} pixel grids` : "error of the nominal run";
  const errors = every.map(of).sort(rise);
  const ratios = every.filter(({ published }) => published && of(published) > 0)
    .map((one) => of(one) / of(one.published)).sort(rise);
  const range = (values, unit) => [...new Set([values[0], values.at(-1)].map(show))]
    .join(" to ") + unit;
  const away = Math.ceil(1000 * (1 - Math.min(...all.map((one) => one.in_view)))) / 10;
  const warning = away > 0 ? ` But up to ${show(away)} % of the marker images are out of view: ` +
    "no camera could give those errors." : "";
  if (!ratios.length)
    return `the ${which} is ${range(errors, " %")}; ` +
      `the published run has no such setting.${warning}`;
  const own = all.filter(({ modes }) => modes.every(({ published }) => !published));
  const alone = own.length ? `in the settings that only this run has, the ${which} is ` +
    `${range(own.flatMap(({ modes }) => modes.map(of)).sort(rise), " %")}. In all others ` : "";
  const middle = (ratios[(ratios.length - 1) >> 1] + ratios[ratios.length >> 1]) / 2;
  const places = ratios.length === 1 ? ""
    : ` (${range(ratios, "")} in the ${ratios.length} settings and modes that both have)`;
  return `${alone}the ${which} is ${show(middle)} times the published one${places}.${warning}`;
}

// `put` takes the viewer's data, whenever there is more; `looked` returns the name of the case in
// sight; `failed` is called where a page may not compute.
export function createRecompute(facts, put, looked, failed) {
  let worker = null, last = 0, waiting = null, frame = 0;
  function indices({ settings }) { // of the settings in sight
    const { case: shown } = settings.find((one) => one.case === looked()) ?? settings[0];
    return settings.flatMap((one, i) => (one.case === shown ? [i] : []));
  }

  function start() {
    const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    worker = new Worker(address);
    URL.revokeObjectURL(address);
    worker.onmessage = ({ data }) => { if (data.id === last) take(data); };
    worker.onerror = (event) => { event.preventDefault(); failed(); };
  }
  function take(found) {
    const { set, plan, values } = waiting;
    if (found.settings)
      return put(waiting.data = describeResults(set, plan, found, values, facts));
    waiting.data.all[found.index].modes.forEach((one, m) => {
      const [median, low, high] = found.bands[m];
      Object.assign(one, { median, low, high });
    });
    frame ||= requestAnimationFrame(() => {
      frame = 0;
      if (waiting?.data) put(waiting.data = { ...waiting.data });
    });
  }
  return {
    // Begins to compute a request, or returns why it is refused or left to the command.
    ask(name, values) {
      const set = facts.sets[name], plan = planRequest(set, values, facts);
      if (!plan.settings) {
        this.stop();
        return plan;
      }
      try { if (!worker) start(); } catch {
        return { left: "what this browser does not let a page do beside itself" };
      }
      last += 1;
      waiting = { set, plan, values };
      worker.postMessage({ ...plan, id: last, draws: DRAWS, first: indices(plan) });
      return {};
    },
    prefer() { if (waiting) worker.postMessage({ first: indices(waiting.plan) }); },
    stop() {
      last += 1;
      waiting = null;
    },
    data: () => waiting?.data,
    comparison: () => (waiting?.data ? compareResults(waiting.data) : ""),
  };
}
