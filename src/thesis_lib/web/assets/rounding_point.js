// Two cameras and a point, in the plane of both: pixels are strips, and two strips measure a height.
import { action, axes, dice, drag, headline, experiment, rms, slider } from "./demo.js";
import { pixelate } from "./pinhole.js";
import { clamp, fixed, lines, path, resize, svg, text } from "./parts.js";

const DISTANCE = 500, FOCAL = (24 / 36) * 320, SPAN = DISTANCE / FOCAL, DRAWS = 400, MOST = 6; // mm, px, mm/px, draws, mm
const angleOf = (degrees) => (degrees * Math.PI) / 180;
const sides = [-1, 1];
// A camera on one side looks down at the elevation; its image coordinate, in px, grows with X by `along` and with Z by `up`.
const rows = (elevation) => sides.map((side) => ({ along: (-side * Math.sin(elevation)) / SPAN, up: Math.cos(elevation) / SPAN }));
const gain = (elevation) => SPAN / (2 * Math.cos(elevation)); // ∂Z/∂m of each camera, mm/px

// Motion of both images in px, its fraction, the gain, and the standard deviation of the measured deflection in mm.
function law({ w, elevation }) {
  const phi = angleOf(elevation), delta = w * rows(phi)[0].up, f = delta - Math.floor(delta), g = gain(phi);
  return { delta, f, g, sigma: g * Math.sqrt(2 * f * (1 - f)) };
}

function measured({ w, elevation }, shifts) { // heights as rebuilt at rest and moved, and where the point is then thought to be
  const phi = angleOf(elevation), by = rows(phi);
  const rebuilt = (z) => {
    const m = by.map(({ up }, i) => pixelate(Float64Array.of(up * z + shifts[i]))[0] - shifts[i]);
    return { x: (m[0] - m[1]) / (2 * by[0].along), z: gain(phi) * (m[0] + m[1]), m };
  };
  const rest = rebuilt(0), moved = rebuilt(w);
  return { rest, moved, error: moved.z - rest.z - w };
}

function build(request, { a, b }) {
  const state = { w: 2, elevation: 30 }, random = dice();
  let shifts = [0, 0], errors = [];
  const set = (changes) => { Object.assign(state, changes); errors = []; request(); };
  const cast = () => [random() - 0.5, random() - 0.5];
  const controls = [
    slider("Deflection w", [0, MOST], 0.05, 2, " mm", () => state.w, (w) => set({ w })),
    slider("Elevation φ", [5, 80], 1, 0, "°", () => state.elevation, (elevation) => set({ elevation })),
    action("One random pair of grids", () => { shifts = cast(); request(); }),
    action(`${DRAWS} random pairs`, () => {
      errors.push(...Array.from({ length: DRAWS }, () => measured(state, cast()).error));
      request();
    }),
  ];

  let height = 300, unit = 1;
  drag(a.canvas, (_, y0) => {
    const { w } = state;
    return (__, y) => set({ w: clamp(Math.round((w + (y0 - y) / unit) * 20) / 20, [0, MOST]) });
  });
  function section(width) { // around the point, a few mm
    const phi = angleOf(state.elevation), { rest, moved } = measured(state, shifts);
    height = 300;
    unit = height / 12;
    const half = width / 2 / unit, x = (mm) => width / 2 + mm * unit, y = (mm) => height - 3 * unit - mm * unit;
    resize(a, width, height).replaceChildren();
    rows(phi).forEach(({ along, up }, i) => {
      const size = Math.hypot(along, up), normal = [along / size, up / size], ray = [-normal[1], normal[0]], far = half + 12;
      const strip = (from, to) => lines([[from, -far], [from, far], [to, far], [to, -far]].map(([across, down]) =>
        [x(normal[0] * across + ray[0] * down), y(normal[1] * across + ray[1] * down)]), "Z");
      const pixel = (m) => strip((m - 0.5) / size, (m + 0.5) / size);
      const many = Math.ceil(far * size);
      a.canvas.append(...Array.from({ length: 2 * many + 1 }, (_, k) => path("tl-demo-edge", pixel(k - many - shifts[i]))),
        path(`tl-demo-strip tl-demo-side${i}`, pixel(rest.m[i])), path(`tl-demo-strip tl-demo-side${i} tl-demo-strong`, pixel(moved.m[i])));
    });
    const point = (cls, px, pz, r) => svg("circle", { class: cls, cx: x(px), cy: y(pz), r });
    const cross = ({ x: px, z }) => path("tl-demo-cross", `M${x(px) - 7} ${y(z) - 7}l14 14m-14 0l14 -14`);
    a.canvas.append(path("tl-demo-true", `M${x(0)} ${y(0)}V${y(state.w)}`), point("tl-demo-rest", 0, 0, 7), point("tl-demo-moved", 0, state.w, 7),
      cross(rest), cross(moved), path("tl-axis", `M12 ${height - 12}h${2 * unit}m0 -4v8m${-2 * unit} 0v-8`), text(18 + 2 * unit, height - 8, "2 mm", null, "start"),
      text(6, 16, "↖ camera 1", "tl-note", "start"), text(width - 6, 16, "camera 2 ↗", "tl-note", "end"));
    headline(a, "The plane of both cameras around the point; drag it up", `Measured deflection ${fixed(moved.z - rest.z, 2)} mm, true ${fixed(state.w, 2)} mm.`);
    a.foot.textContent = "circles: true; crosses: where the middle of the strips meets";
  }

  function spread(width) { // how often which error comes out
    const { f, g, sigma } = law(state);
    const most = Math.max(1, 1.3 * 2 * g), { x, y, bottom } = axes(b, width, [-most, most], [0, 1], "error of the deflection, mm", "share of the draws");
    const chances = [[-2 * f, (1 - f) ** 2], [1 - 2 * f, 2 * f * (1 - f)], [2 - 2 * f, f * f]].map(([e, p]) => [g * e, p]);
    const near = (one) => (error) => Math.abs(error - one) < 1e-6;
    b.canvas.append(...chances.flatMap(([error, chance]) => {
      const share = errors.filter(near(error)).length / (errors.length || 1), bar = 12;
      return [svg("rect", { class: "tl-demo-bar", x: x(error) - bar / 2, y: y(share), width: bar, height: Math.max(0, bottom - y(share)) }),
        path("tl-demo-expected", `M${x(error) - 11} ${y(chance)}h22`)];
    }), ...[sigma, -sigma].map((v) => path("tl-demo-law", `M${x(v)} ${bottom}V${y(1)}`)));
    headline(b, "Errors on random pairs of grids", `Standard deviation by the law ${fixed(sigma, 2)} mm.`);
    b.foot.textContent = "lines: expected shares; bars: drawn; dashed: ± one standard deviation by the law";
  }

  function draw(width) {
    section(width.a);
    const { delta, f, g, sigma } = law(state);
    spread(width.b);
    return `Both images move by δ = w cos φ · c/R = ${fixed(delta, 2)} px. A pixel more in one of them raises the point by g = ${fixed(g, 2)} mm. ` +
      `So the error is √(g² · ${fixed(f * (1 - f), 3)} + g² · ${fixed(f * (1 - f), 3)}) = ${fixed(sigma, 2)} mm.` +
      (errors.length ? ` Of ${errors.length} draws: ${fixed(rms(errors), 2)} mm.` : "");
  }
  return { controls, draw, model: { state, set, law, errors: () => errors } };
}

export default { render: ({ el }) => experiment(el, "point", "Two cameras and a point", ["a", "b"], build) };
