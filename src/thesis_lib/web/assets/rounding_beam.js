// Many cameras and a beam: errors of its markers, drawn and by the law, and what one more camera is worth.
import { action, axes, dice, headline, experiment, slider } from "./demo.js";
import {
  deflectionShape, deflectionVariance, markers, measureDeflections, worldPoints,
} from "./physics.js";
import { hemisphereCameras } from "./pinhole.js";
import { fixed, lines, path, svg } from "./parts.js";

const DISTANCE = 0.5, SIZE = [320, 180], MOST = 24, DRAWS = 400;
const root = (values) => Array.from(values, Math.sqrt);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function build(request, { a, b, c }, { structure, sensorWidth }) {
  const state = { cameras: 4, mode: 3, amplitude: 5.5, elevation: 35 }, [places] = markers(structure);
  const focal = (24 / sensorWidth) * SIZE[0], random = dice();
  let scene = null;
  function set(changes) { Object.assign(state, changes); scene = null; request(); }
  function seen(cameras) { // what does not change from draw to draw; cameras stand evenly, none on an axis of the beam
    const directions = Array.from({ length: cameras }, (_, i) => [((i + 0.3) * 2 * Math.PI) / cameras, (state.elevation * Math.PI) / 180]);
    const P = hemisphereCameras(DISTANCE, directions, focal, SIZE);
    const reference = deflectionShape(structure, state.mode, state.amplitude / 1000);
    const [rest, deflected] = [reference.map(() => 0), reference].map((w) => worldPoints(structure, w));
    return { P, rest, deflected, reference, variance: deflectionVariance(P, rest, deflected) };
  }
  const rise = (variance) => 1000 * Math.sqrt(mean(variance)); // over all markers, mm
  function prepare() {
    scene = { ...seen(state.cameras), draws: 0, squares: places.map(() => 0), last: null };
    scene.curve = Array.from({ length: MOST - 1 }, (_, i) => [i + 2, rise(seen(i + 2).variance)]);
  }
  function one() { // one more draw
    const { P, rest, deflected, reference, squares } = scene;
    const shifts = Float64Array.from({ length: 2 * state.cameras }, () => random() - 0.5);
    scene.last = measureDeflections(P, rest, deflected, shifts);
    scene.last.forEach((w, i) => { squares[i] += (w - reference[i]) ** 2; });
    scene.draws += 1;
  }
  const controls = [
    slider("Cameras", [2, MOST], 1, 0, "", () => state.cameras, (cameras) => set({ cameras })),
    slider("Mode", [1, 3], 1, 0, "", () => state.mode, (mode) => set({ mode })),
    slider("Amplitude", [0.5, 12], 0.5, 1, " mm", () => state.amplitude, (amplitude) => set({ amplitude })),
    slider("Elevation", [5, 80], 5, 0, "°", () => state.elevation, (elevation) => set({ elevation })),
    action("Draw again", () => set({})),
  ];
  const across = [0, 1000 * structure.length], dots = (x, y, values, cls, r) =>
    values.map((value, i) => svg("circle", { cx: x(1000 * places[i]), cy: y(value), r, class: cls }));

  function shape(width) {
    const most = state.amplitude * 1.25, { x, y } = axes(a, width, across, [-most, most], "along the beam, mm", "deflection, mm");
    a.canvas.append(path("tl-reference", lines(Array.from(scene.reference, (w, i) => [x(1000 * places[i]), y(1000 * w)]))),
      ...dots(x, y, Array.from(scene.last, (w) => 1000 * w), "tl-demo-moved", 3));
    headline(a, "The shape, as these cameras measured it last");
    a.foot.textContent = "line: the true shape; dots: one draw";
  }
  function errors(width) {
    const law = root(scene.variance).map((s) => 1000 * s), drawn = scene.squares.map((s) => 1000 * Math.sqrt(s / scene.draws));
    const { x, y } = axes(b, width, across, [0, 1.3 * Math.max(...law)], "along the beam, mm", "rms error, mm");
    b.canvas.append(path("tl-demo-law", lines(law.map((s, i) => [x(1000 * places[i]), y(s)]))), ...dots(x, y, drawn, "tl-demo-dot", 3));
    headline(b, "The error of every marker", `By the law ${fixed(Math.min(...law), 2)} to ${fixed(Math.max(...law), 2)} mm.`);
    b.foot.textContent = `dashed: by the law; dots: of ${scene.draws} draws`;
  }
  function number(width) {
    const { curve } = scene, { x, y } = axes(c, width, [2, MOST], [0, 1.1 * curve[0][1]], "cameras", "rms error over the markers, mm");
    const root2 = curve[0][1] * Math.SQRT2;
    c.canvas.append(path("tl-wire", lines(curve.map(([n]) => [x(n), y(root2 / Math.sqrt(n))]))),
      path("tl-demo-law", lines(curve.map(([n, s]) => [x(n), y(s)]))),
      svg("circle", { cx: x(state.cameras), cy: y(rise(scene.squares.map((s) => s / scene.draws))), r: 5, class: "tl-demo-dot" }));
    headline(c, "What more cameras are worth");
    c.foot.textContent = "dashed: by the law; faint: as 1/√N; dot: the draws";
  }
  function draw(width) {
    if (!scene) prepare();
    const end = performance.now() + 8; // ms, so that sliders stay fluid
    do one(); while (scene.draws < DRAWS && performance.now() < end);
    if (scene.draws < DRAWS) request();
    shape(width.a);
    errors(width.b);
    number(width.c);
    const law = rise(scene.variance), drawn = rise(scene.squares.map((s) => s / scene.draws));
    return `Over all ${places.length} markers the law predicts ${fixed(law, 3)} mm, ${fixed((100 * law) / state.amplitude, 2)} % of the amplitude. ` +
      (scene.draws < DRAWS ? "Drawing …" : `${DRAWS} draws give ${fixed(drawn, 3)} mm, ${fixed(drawn / law, 3)} of it.`);
  }
  return { controls, draw, model: { state, set, scene: () => scene } };
}

export default { render: ({ model: traits, el }) =>
  experiment(el, "beam", "Many cameras and a beam", ["a", "b", "c"], (request, panels) => build(request, panels, traits.get("data"))) };
