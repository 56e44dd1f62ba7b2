// One marker on one pixel grid: what rounding makes of its motion, and the law of rounding from draws.
import { action, axes, dice, drag, headline, experiment, rms, slider } from "./demo.js";
import { pixelate } from "./pinhole.js";
import { clamp, fixed, lines, path, resize, svg, text } from "./parts.js";

const REST = 0.2, MOST = 3, DRAWS = 200;
const law = (motion) => { const f = motion % 1; return Math.sqrt(f * (1 - f)); };
// Rest and moved image in whole pixels of a grid that is shifted, and the error of their difference.
function measured(motion, shift) {
  const [from, to] = pixelate(Float64Array.of(REST + shift, REST + motion + shift));
  return { from: from - shift, to: to - shift, error: to - from - motion };
}

function build(request, { a, b, c }) {
  const state = { motion: 1.3, shift: 0 }, random = dice(), found = new Map(); // motion to errors drawn
  const set = (changes) => { Object.assign(state, changes); request(); };
  const place = (motion) => clamp(Math.round(100 * motion) / 100, [0, MOST]);
  const draws = (motion, count) => {
    const errors = found.get(motion) ?? [];
    for (let i = 0; i < count; i += 1) errors.push(measured(motion, random() - 0.5).error);
    found.set(motion, errors);
  };
  let sweep = [];
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const controls = [
    slider("Motion δ", [0, MOST], 0.01, 2, " px", () => state.motion, (motion) => set({ motion })),
    slider("Shift of the grid", [-0.5, 0.5], 0.01, 2, " px", () => state.shift, (shift) => set({ shift })),
    action("One random grid", () => set({ shift: Math.round(100 * (random() - 0.5)) / 100 })),
    action(`${DRAWS} random grids`, () => { draws(state.motion, DRAWS); request(); }),
    action("… for every motion", () => { sweep = Array.from({ length: 60 }, (_, i) => (i + 1) / 20); request(); }),
  ];

  // (a) the grid: pixels as boxes around their centres, the marker at rest and moved
  let scale = null;
  drag(a.canvas, (x0) => {
    const { x, unit } = scale, from = { ...state };
    if (Math.abs(x0 - x(REST + state.motion)) < 24) return (now) => set({ motion: place(from.motion + (now - x0) / unit) });
    return (now) => {
      const shift = from.shift - (now - x0) / unit;
      set({ shift: Math.round(100 * (shift - Math.round(shift))) / 100 });
    };
  });
  function grid(width) {
    const left = -1, unit = width / (MOST + 2.5), x = (u) => (u - left) * unit, { motion, shift } = state;
    const { from, to } = measured(motion, shift), height = 168, middle = 74;
    scale = { x, unit };
    const cells = Array.from({ length: MOST + 5 }, (_, i) => i - 2 - shift);
    const arrow = (y, one, two, cls) => path(cls, `M${x(one)} ${y - 5}v10M${x(one)} ${y}H${x(two)}` +
      (two > one ? `m-7 -4l7 4l-7 4` : ""));
    const is = (cell, one) => Math.abs(cell - one) < 1e-6;
    resize(a, width, height).replaceChildren(
      ...cells.map((cell) => svg("rect", { x: x(cell - 0.5), y: middle - 22, width: unit, height: 44,
        class: `tl-demo-pixel${is(cell, from) || is(cell, to) ? " tl-demo-hit" : ""}` })),
      ...cells.map((cell) => path("tl-axis", `M${x(cell)} ${middle + 18}v8`)),
      ...[[REST, "tl-demo-rest"], [REST + motion, "tl-demo-moved"]].map(([u, cls]) =>
        svg("circle", { cx: x(u), cy: middle, r: 8, class: cls })),
      arrow(30, REST, REST + motion, "tl-demo-true"), arrow(124, from, to, "tl-demo-read"),
      text(x(REST), 18, `moves by ${fixed(motion, 2)} px`, "tl-demo-truth", "start"),
      text(x(from), 146, `measured: ${fixed(to - from, 0)} px`, "tl-demo-reading", "start"));
    headline(a, "Drag the moved marker, or the grid", `It moves by ${fixed(motion, 2)} px and is measured as ${fixed(to - from, 0)} px.`);
  }

  // (b) the error for every shift of the grid
  function shifts(width) {
    const { x, y, right } = axes(b, width, [-0.5, 0.5], [-1, 1], "shift of the grid, px", "error, px"), { motion, shift } = state;
    let d = "", last = null;
    for (let i = 0; i <= 400; i += 1) {
      const s = (i - 200) / 400, { error } = measured(motion, s);
      d += `${last === error ? "L" : "M"}${x(s).toFixed(1)} ${y(error).toFixed(1)}`;
      last = error;
    }
    const one = law(motion);
    b.canvas.append(...[one, -one].map((v) => path("tl-demo-law", `M${x(-0.5)} ${y(v)}H${right}`)), path("tl-demo-step", d),
      svg("circle", { cx: x(shift), cy: y(measured(motion, shift).error), r: 6, class: "tl-demo-moved" }));
    headline(b, "Its error on every grid", `Two values, one pixel apart; their rms is ${fixed(one, 2)} px.`);
    b.foot.textContent = "dashed: ± rms error by the law";
  }

  // (c) rms errors of the draws beside the law
  function curve(width) {
    const { x, y } = axes(c, width, [0, MOST], [0, 0.6], "motion δ, px", "rms error, px");
    const points = Array.from({ length: 301 }, (_, i) => [x((i * MOST) / 300), y(law((i * MOST) / 300))]);
    c.canvas.append(path("tl-demo-law", lines(points)), ...[...found].map(([motion, errors]) =>
      svg("circle", { cx: x(motion), cy: y(rms(errors)), r: 3, class: "tl-demo-dot" })),
    svg("circle", { cx: x(state.motion), cy: y(law(state.motion)), r: 6, class: "tl-demo-ring" }));
    headline(c, "The rms error of every motion", "It is zero for whole pixels and half a pixel for half ones.");
    c.foot.textContent = `dashed: the law √(f(1 − f)); dots: rms of ${DRAWS} grids or more`;
  }

  function draw(width) {
    if (sweep.length) {
      sweep.splice(0, still.matches ? sweep.length : 1).forEach((motion) => draws(motion, DRAWS));
      if (sweep.length) request();
    }
    grid(width.a);
    shifts(width.b);
    curve(width.c);
    const { motion } = state, whole = Math.floor(motion + 1e-9), f = Math.max(0, motion - whole), errors = found.get(motion);
    const share = (part) => `${fixed(100 * part, 0)} of 100 grids`;
    return (f < 1e-9 ? `A motion of ${whole} px is measured without error on every grid.`
      : `${share(1 - f)} measure ${whole} px, an error of −${fixed(f, 2)} px; ${share(f)} measure ${whole + 1} px, an error of ` +
        `+${fixed(1 - f, 2)} px. The rms of all is √(${fixed(f, 2)} · ${fixed(1 - f, 2)}) = ${fixed(law(motion), 3)} px.`) +
      (errors ? ` Of ${errors.length} draws: ${fixed(rms(errors), 3)} px.` : "");
  }
  return { controls, draw, model: { state, found, law, measured, set } };
}

export default { render: ({ el }) => experiment(el, "marker", "One marker on one pixel grid", ["a", "b", "c"], build) };
