// Runs beside the page: settings come in; the nominal run and the law of all of them go out at once, then the bands of each
// one as soon as its draws are made, those that are looked at first.
import simulation from "./simulation.js";
import model from "./explorer_model.js";

const SLICE = 40; // ms until it looks for other wishes
let job = null;

function begin({ id, structure, shapes, settings, draws, first }) {
  const found = settings.map((setting) => simulation.simulate(setting, structure, shapes));
  const busy = Boolean(job?.queue.length);
  job = { id, draws, found, queue: found.map((_, i) => i) };
  prefer(first);
  postMessage({ id, markers: model.markers(structure), references: found[0].modes.map(({ reference }) => reference),
    settings: found.map(({ inView, modes }) => ({ inView, modes: modes.map(({ measured, errors, predicted }) =>
      ({ measured: Array.from(measured), errors, predicted })) })) });
  if (!busy) setTimeout(work);
}
function prefer(first) {
  job.queue = [...job.queue.filter((i) => first.includes(i)), ...job.queue.filter((i) => !first.includes(i))];
}
function work() {
  const end = performance.now() + SLICE, { id, draws, found, queue } = job;
  while (queue.length && performance.now() < end) {
    const [i] = queue, { modes, draw } = found[i];
    draw();
    if (modes[0].means.length < draws) continue;
    queue.shift();
    postMessage({ id, index: i, left: queue.length, bands: modes.map(({ means, peaks }) => [means, peaks].map(simulation.band)) });
  }
  if (queue.length) setTimeout(work);
}
onmessage = ({ data }) => {
  if (data.settings) begin(data); else if (job) prefer(data.first);
};
