// Takes settings; returns the nominal run and the predicted errors of all of them at once, then the
// band of each one when it is drawn, those in sight first.
import { bandOf, markers, simulateSetting } from "./physics.js";

const SLICE = 40; // ms until it looks for other wishes
let job = null;

function begin({ id, structure, shapes, settings, draws, first }) {
  const found = settings.map((setting) => simulateSetting(setting, structure, shapes));
  const busy = Boolean(job?.queue.length);
  job = { id, draws, found, queue: found.map((_, i) => i) };
  prefer(first);
  const results = found.map(({ inView, modes }) => ({ inView, modes }));
  postMessage({ id, markers: markers(structure), settings: results });
  if (!busy) setTimeout(work);
}
function prefer(first) {
  const rank = (i) => Number(!first.includes(i));
  job.queue.sort((one, two) => rank(one) - rank(two));
}
function work() {
  const end = performance.now() + SLICE, { id, draws, found, queue } = job;
  while (queue.length && performance.now() < end) {
    const [index] = queue, { modes, draw } = found[index];
    draw();
    if (modes[0].means.length < draws) continue;
    queue.shift();
    postMessage({ id, index, bands: modes.map(({ means }) => bandOf(means)) });
  }
  if (queue.length) setTimeout(work);
}
onmessage = ({ data }) => {
  if (data.settings) begin(data); else if (job) prefer(data.first);
};
