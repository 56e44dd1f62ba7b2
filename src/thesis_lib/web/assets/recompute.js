// A request of chapter 3 or 4 computed in the page: a worker measures it, and what it says becomes
// the viewer's data.
import { isNumber, show } from "./parts.js";
import source from "./recompute_worker.js";
import { formatGeneral } from "./request.js";
import { planRequest } from "./setups.js";

const DRAWS = 200;
const toMm = (values) => values.map((value) => 1000 * value);

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
      reference_mm: toMm(found.references[m]) })),
    cases: [...new Set(settings.map((one) => one.case))].map((name) => ({
      name, title: ownPair || (set.titles[name] ?? "own layout"), figures: {},
      settings: all.filter((_, i) => settings[i].case === name),
    })),
  };
}

// How the errors compare with those of the published run, in a sentence, and another one where
// cameras would miss markers, which are computed all the same.
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

// `put` is given the viewer's data, and again when there is more; `looked` tells the name of the
// case that is looked at; `failed` is called where a page may not compute.
export function createRecompute(facts, put, looked, failed) {
  let worker = null, last = 0, waiting = null, frame = 0;
  const times = {}; // ms from the request, for tests
  const caseOf = ({ settings }) =>
    (settings.find((one) => one.case === looked()) ?? settings[0]).case;
  const indices = (plan) =>
    plan.settings.flatMap((one, i) => (one.case === caseOf(plan) ? [i] : []));

  function start() {
    const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    worker = new Worker(address);
    URL.revokeObjectURL(address);
    worker.onmessage = ({ data }) => { if (data.id === last) take(data); };
    worker.onerror = (event) => { event.preventDefault(); failed(); };
  }
  function take(found) {
    const since = performance.now() - waiting.begun, { set, plan, values } = waiting;
    if (found.settings) {
      waiting.data = describeResults(set, plan, found, values, facts);
      times.literal = since;
      return put(waiting.data);
    }
    waiting.data.all[found.index].modes.forEach((one, m) => {
      const [[median, low, high]] = found.bands[m];
      Object.assign(one, { median, low, high });
    });
    if (plan.settings[found.index].case === caseOf(plan)) times.looked = since;
    if (!found.left) times.drawn = since;
    frame ||= requestAnimationFrame(() => {
      frame = 0;
      if (waiting?.data) put(waiting.data = { ...waiting.data });
    });
  }
  return {
    times,
    // A request by the values of its parameters: says why it is refused or left to the command, or
    // begins to compute it.
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
      Object.assign(times, { literal: null, looked: null, drawn: null });
      waiting = { set, plan, values, begun: performance.now() };
      worker.postMessage({ ...plan, id: last, draws: DRAWS, first: indices(plan) });
      return {};
    },
    prefer() { if (waiting) worker.postMessage({ first: indices(waiting.plan) }); },
    stop() {
      last += 1;
      waiting = null;
    },
    comparison: () => (waiting?.data ? compareResults(waiting.data) : ""),
  };
}
