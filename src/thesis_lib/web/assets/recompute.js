// A request of chapter 3 or 4 computed in the page: a worker measures it, and what it says becomes the viewer's data.
import setups from "./setups.js";
import source from "./recompute_worker.js";
import { isNumber, show } from "./parts.js";
import request from "./request.js";

export default (() => {
  const DRAWS = 200, { general } = request;
  const mm = (values) => values.map((value) => 1000 * value);
  const round = (values) => values.map((value) => Math.round(1e3 * value) / 1e3);

  // What the viewer draws, before the draws. `facts` are those of figure_sets/parametric/in_page.py.
  function dataOf({ subject, parameter, titles, published }, { settings, structure, shapes }, said, values, facts) {
    const [x, y] = said.markers.map((axis) => round(mm(axis))), { grid, hertz, length, width } = structure;
    const known = new Map(published.map(([name, value, order, mode, ...numbers]) => [[name, value, order, mode].join(), numbers]));
    const shownAs = (one, i) => ({
      label: one.label, value: one.value, resolution: one.size, in_view: said.settings[i].inView,
      cameras: one.cameras.map((direction) => [one.distance, ...direction]),
      modes: said.settings[i].modes.map(({ measured, errors, predicted }, m) => {
        const before = known.get([one.case, one.value, one.order ?? "", shapes[m].mode].join());
        return { measured_mm: mm(measured), point_error: errors.point, mean: errors.mean, largest: errors.largest, predicted,
          stated: null, published: before && { mean: before[0], median: before[1], low: before[2], high: before[3] } };
      }),
    });
    const all = settings.map(shownAs);
    return {
      structure: { kind: subject, length_mm: 1000 * length, width_mm: 1000 * width }, parameter, colors: facts.colors,
      words: { draws: `${DRAWS} pixel grids`, predicts: "law of rounding" }, ...(grid ? { colormap: facts.colormap, grid } : {}),
      x_mm: grid ? x.slice(0, grid[0]) : x, ...(grid ? { y_mm: y.filter((_, n) => n % grid[0] === 0) } : {}),
      lens: Object.fromEntries(facts.lens.map((name) => [name, values[name]])), all,
      modes: shapes.map(({ mode }, m) =>
        ({ mode, frequency_hz: hertz[mode - 1], reference_mm: mm(said.references[m]) })),
      cases: [...new Set(settings.map((one) => one.case))].map((name) => ({ name,
        title: "azimuth_deg" in values ? `a pair at ±${general(values.azimuth_deg)}°` : titles[name] ?? "own layout",
        figures: {}, settings: all.filter((_, i) => settings[i].case === name) })),
    };
  }

  // How the errors compare with those of the published run, and that cameras would miss markers which are computed all the same.
  function comparison(data) {
    const away = Math.ceil(1000 * (1 - Math.min(...data.all.map((one) => one.in_view)))) / 10;
    return compared(data) + (away > 0 ? ` But up to ${show(away)} % of the marker images are out of view: no camera could give those errors.` : "");
  }
  // One sentence.
  function compared({ all }) {
    const every = all.flatMap((one) => one.modes), done = every.every((one) => isNumber(one.median));
    const of = (one) => (done ? one.median : one.mean), before = (one) => (done ? one.published.median : one.published.mean);
    const which = done ? `median error over ${DRAWS} pixel grids` : "literal error", errors = every.map(of).sort((a, b) => a - b);
    const range = (values, unit) => (show(values[0]) === show(values.at(-1)) ? `${show(values[0])}${unit}`
      : `${show(values[0])} to ${show(values.at(-1))}${unit}`);
    const ratios = every.filter((one) => one.published && before(one) > 0).map((one) => of(one) / before(one)).sort((a, b) => a - b);
    if (!ratios.length) return `the ${which} is ${range(errors, " %")}; the published run has no such setting.`;
    const middle = ratios.length % 2 ? ratios[(ratios.length - 1) / 2] : (ratios[ratios.length / 2 - 1] + ratios[ratios.length / 2]) / 2;
    const places = ratios.length === 1 ? "" : ` (${range(ratios, "")} in the ${ratios.length} settings and modes that both have)`;
    return `the ${which} is ${show(middle)} times the published one${places}.`;
  }

  // `put` is given the viewer's data, and again when there is more; `looked` tells the name of the case that is looked at.
  return function create(facts, put, looked, failed) {
    let worker = null, last = 0, waiting = null, frame = 0;
    const times = {}; // ms from the request, for tests
    const caseOf = ({ settings }) => (settings.find((one) => one.case === looked()) ?? settings[0]).case; // that is looked at
    const indices = (asked) => asked.settings.flatMap((one, i) => (one.case === caseOf(asked) ? [i] : []));

    function start() {
      const address = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
      worker = new Worker(address);
      URL.revokeObjectURL(address);
      worker.onmessage = ({ data }) => { if (data.id === last) take(data); };
      worker.onerror = (event) => { event.preventDefault(); failed(); };
    }
    function take(said) {
      const since = performance.now() - waiting.begun;
      if (said.settings) {
        waiting.data = dataOf(waiting.set, waiting.asked, said, waiting.values, facts);
        times.literal = since;
        return put(waiting.data);
      }
      waiting.data.all[said.index].modes.forEach((one, m) => {
        const [[median, low, high]] = said.bands[m];
        Object.assign(one, { median, low, high });
      });
      if (waiting.asked.settings[said.index].case === caseOf(waiting.asked)) times.looked = since;
      if (!said.left) times.drawn = since;
      frame ||= requestAnimationFrame(() => {
        frame = 0;
        if (waiting?.data) put(waiting.data = { ...waiting.data });
      });
    }
    return {
      times,
      // A request by the values of its parameters: says why it is refused or left to the command, or begins to compute it.
      ask(name, values) {
        const set = facts.sets[name], asked = setups.asked(set, values, facts), { settings, structure, shapes } = asked;
        if (!settings) {
          this.stop();
          return asked;
        }
        try { if (!worker) start(); } catch { return { left: "what this browser does not let a page do beside itself" }; }
        last += 1;
        Object.assign(times, { literal: null, looked: null, drawn: null });
        waiting = { set, asked, values, begun: performance.now() };
        worker.postMessage({ id: last, structure, shapes, settings, draws: DRAWS, first: indices(asked) });
        return {};
      },
      prefer() { if (waiting) worker.postMessage({ first: indices(waiting.asked) }); },
      stop() {
        last += 1;
        waiting = null;
      },
      comparison: () => (waiting?.data ? comparison(waiting.data) : ""),
    };
  };
})();
