// A request of chapter 3 or 4, computed in the page: settings, as in facts/setups.py, refusals of
// values out of bounds, with the text of figure_sets/parametric, and the viewer's data.
import { isNumber, show } from "./parts.js";
import { MAX_CAMERAS, bandOf, markers, simulateSetting } from "./physics.js";
import { apart, rint } from "./pinhole.js";
import { formatGeneral, formatGiven } from "./request.js";

const DRAWS = 200;
const MAX_IMAGES = 1e6; // of markers, computed in a page at most
const SLICE_MS = 20; // ms of computing until the page may do other work
const PAUSE_MS = 500; // ms between two drawings of the bands

// --- settings, by varied parameter; `facts` are the thesis's
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
  resolution: (v) => v.widths_px.map((width) => {
    const size = [width, rint((width * 9) / 16)];
    return { case: "3", value: width, label: size.join("×"), cameras: pairOf(v), size };
  }),
  arrays: (v, { pairs, order: usual }) => {
    const grown = v.cases.map((name) => {
      const order = v.pair_order[name] ?? usual[name] ?? "printed";
      const ordered = order === "reversed" ? pairs[name].toReversed() : pairs[name];
      return [name, order, ordered.map((_, n) => ordered.slice(0, n + 1).flat())];
    });
    const own = Object.entries(v.layouts).map(([name, sets]) => [name, "", sets]);
    return [...grown, ...own].flatMap(([name, order, sets]) => sets.map((cameras) => ({
      case: name, value: cameras.length, label: `${cameras.length} cameras`, cameras, order,
    })));
  },
};
function peaksOf({ amplitude_mm: given, modes }, { peaks }) { // in m
  if (given === "force") return modes.map((mode) => Number(peaks[mode - 1]));
  return modes.map((_, i) => (Array.isArray(given) ? given[i] : given) / 1000);
}

// --- refusals
function findCoincident({ cameras }) { // the first two cameras at the same position
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
    const own = layouts && Object.hasOwn(layouts, one.case);
    const field = own ? "layouts" : same[0][1] < 90 ? "azimuth_deg"
      : one.case in opposite ? "elevations_deg" : "elevation_deg";
    const place = [formatGiven(one.case), one.label];
    return refuse(field, same,
      place.reduce((text, part) => text.replace("{}", () => part), conditions.places));
  }
  if (!layouts) return "";
  const names = Object.keys(layouts), own = names.every((name) => !Object.hasOwn(pairs, name));
  if (!cases.length && !names.length) return refuse("cases", cases, conditions.cases);
  const grow = Object.values(layouts)
    .every((sets) => sets.every((one, i) => !i || sets[i - 1].length < one.length));
  return grow && own ? "" : refuse("layouts", layouts, conditions.layouts);
}
function findLimit({ estimator, noise_px: noise, modes }, settings, count) { // the exceeded limit, or ""
  if (estimator !== "least-squares") return `the estimator ${estimator}`;
  if (noise > 0) return "noise in the images";
  const counts = settings.map((one) => one.cameras.length), most = Math.max(...counts);
  if (most > MAX_CAMERAS) return `${most} cameras (a page takes ${MAX_CAMERAS})`;
  const images = counts.reduce((sum, one) => sum + one, 0) * (modes.length + 1) * count;
  return images > MAX_IMAGES ? `${images} images of markers (a page takes ${MAX_IMAGES})` : "";
}

// Settings, modes with largest deflections and structure of a request; or a `problem`; or the
// reason why it is `left` to the command.
function planRequest({ subject, study }, values, facts) {
  const given = facts.structures[subject], peaks = peaksOf(values, given);
  const common = { distance: values.distance_mm, size: values.resolution_px };
  const settings = SETTINGS[study](values, facts).map((one) => ({ ...common, ...one }));
  const problem = findProblem(values, settings, peaks, facts, given);
  if (problem) return { problem };
  const structure = given.row
    ? { ...given, row: { ...given.row, first: values.first_marker_mm / 1000 } }
    : { ...given, grid: values.grid };
  const [nx, ny] = structure.grid ?? [given.row.count, 1];
  const left = findLimit(values, settings, nx * ny);
  if (left) return { left };
  const turn = ([azimuth, elevation]) => [90 - azimuth, elevation];
  return {
    settings: settings.map((one) => ({ ...one,
      cameras: values.azimuth_zero === "X" ? one.cameras.map(turn) : one.cameras,
      focal: (values.focal_length_mm * one.size[0]) / values.sensor_width_mm,
      known: values.rest === "known", offset: values.principal_offset_px })),
    structure, shapes: values.modes.map((mode, i) => ({ mode, peak: peaks[i] })),
  };
}

// --- results
const toMm = (values) => Array.from(values, (value) => 1000 * value);

// The viewer's data, before the trials. `facts` are those of figure_sets/parametric/in_page.py.
function describeResults({ set, plan, values, runs }, facts) {
  const { settings, structure, shapes } = plan, { grid, hertz, length, width } = structure;
  const [x, y] = markers(structure)
    .map((axis) => toMm(axis).map((v) => Math.round(1e3 * v) / 1e3));
  const known = new Map(set.published.map(([name, value, order, mode, ...statistics]) =>
    [[name, value, order, mode].join(), statistics]));
  const all = settings.map((one, i) => ({
    label: one.label, value: one.value, resolution: one.size, in_view: runs[i].inView,
    cameras: one.cameras.map((direction) => [one.distance, ...direction]),
    modes: runs[i].modes.map(({ measured, errors, predicted }, m) => {
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
      reference_mm: toMm(runs[0].modes[m].reference) })),
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

// `put` takes the viewer's data whenever there is more; `looked` returns the name of the visible
// case. The page stays responsive, since it computes in slices.
export function createRecompute(facts, put, looked) {
  let job = null, jobs = 0;
  const { port1, port2 } = new MessageChannel(); // timers are throttled in a hidden page
  port1.onmessage = ({ data }) => { if (data === job?.id) work(job); };
  function work(own) { // nominal runs of all settings, then trials of each, visible ones first
    const { plan: { settings, structure, shapes }, runs, left } = own;
    const end = performance.now() + SLICE_MS;
    while (job === own && performance.now() < end) {
      const isInSight = (i) => settings[i].case === looked(), n = left.find(isInSight) ?? left[0];
      if (runs.length < settings.length) {
        runs.push(simulateSetting(settings[runs.length], structure, shapes));
        if (runs.length === settings.length) put(own.data = describeResults(own, facts));
      } else if (n === undefined) break;
      else if (runs[n].modes[0].means.length < DRAWS) runs[n].draw();
      else {
        left.splice(left.indexOf(n), 1);
        own.data.all[n].modes.forEach((one, m) => {
          const [median, low, high] = bandOf(runs[n].modes[m].means);
          Object.assign(one, { median, low, high });
        });
        own.hasMore = true;
      }
    }
    if (job !== own) return;
    if (own.hasMore && (!left.length || end > own.next)) { // drawing many settings is slow
      put(own.data = { ...own.data });
      Object.assign(own, { hasMore: false, next: performance.now() + PAUSE_MS });
    }
    if (left.length) port2.postMessage(own.id);
  }
  return {
    // Starts to compute a request, or returns why it is refused or left to the command.
    ask(name, values) {
      const set = facts.sets[name], plan = planRequest(set, values, facts);
      job = plan.settings ? { id: jobs += 1, set, plan, values, runs: [], next: 0,
        left: [...plan.settings.keys()] } : null;
      if (job) work(job);
      return plan;
    },
    stop() { job = null; },
    data: () => job?.data,
    comparison: () => (job?.data ? compareResults(job.data) : ""),
  };
}
