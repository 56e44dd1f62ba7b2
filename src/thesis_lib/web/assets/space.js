// 3-D sketches: vectors, surroundings of a structure, cameras, rotation, bending.
import { ARROWS, clamp, fill, followDrag, lines, path, text } from "./parts.js";
import { towards } from "./pinhole.js";

// World frame: X along the structure, Y across, Z up; azimuth from +Y to +X, elevation from XY.
export const RAD = Math.PI / 180;
const sideways = (azimuth) => [-Math.cos(azimuth * RAD), Math.sin(azimuth * RAD), 0];
export const times = (v, k) => v.map((c) => c * k);
export const plus = (u, v) => u.map((c, i) => c + v[i]);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0]];
export const trace = (point, steps = 72) =>
  Array.from({ length: steps + 1 }, (_, i) => point(i / steps));
export const SQUARE = [[-1, -1], [1, -1], [1, 1], [-1, 1]];

// Directions to the viewer and of the screen, positions on the screen, and lines through points.
export function orbit(view, unit, [x, y]) {
  const viewer = towards([view.azimuth, view.elevation]), right = sideways(view.azimuth);
  const up = cross(viewer, right), flat = (v) => [x + unit * dot(v, right), y - unit * dot(v, up)];
  const line = (cls, points, end = "", style = null) =>
    path(cls, lines(points.map(flat), end), { style });
  return { viewer, right, up, flat, line, unit, centre: [x, y] };
}
// As orbit(), for a hemisphere that fills a drawing except for some px at its sides.
export function orbitHemisphere(view, radius, width, height, sides) {
  const sine = Math.sin(view.elevation * RAD);
  const unit = Math.min((width - sides) / 2, (height - 44) / (1 + sine)) / radius;
  return orbit(view, unit, [width / 2, (height + unit * radius * (1 - sine)) / 2]);
}

export const drawRing = ({ line }, radius, elevation = 0) =>
  line("tl-wire", trace((t) => times(towards([360 * t, elevation]), radius)));
export const drawHemisphere = (space, radius) => [
  ...[0, 30, 60].map((elevation) => drawRing(space, radius, elevation)),
  ...[0, 45, 90, 135].map((azimuth) =>
    space.line("tl-wire", trace((t) => times(towards([azimuth, 180 * t]), radius))))];

// Axes that begin at distances `from` the origin and have the length `size`.
export const drawAxes = ({ flat, line }, from, size) => ["X", "Y", "Z"].flatMap((name, i) => {
  const axis = [0, 1, 2].map((k) => Number(k === i));
  const [x, y] = flat(times(axis, from[i] + 1.35 * size));
  return [line("tl-axis", [from[i], from[i] + size].map((end) => times(axis, end))),
    text(x, y + 4, name, "tl-muted")];
});

export const drawClamp = ({ line }, half, radius) =>
  line("tl-clamp", SQUARE.map(([u, v]) => [-half, u * 0.07 * radius, v * 0.05 * radius]), "Z");

// A camera as a pyramid: its base is `size` from the tip towards the origin, with horizontal long
// sides. Its width is `spread` times that distance, its height `ratio` times the width.
export function drawCamera({ line, flat }, tip, size, spread = 1, ratio = 0.56) {
  const out = times(tip, 1 / Math.hypot(...tip)), azimuth = Math.atan2(tip[0], tip[1]) / RAD;
  const side = times(sideways(azimuth), (size * spread) / 2), over = times(cross(side, out), ratio);
  const base = SQUARE.map(([u, v]) =>
    [0, 1, 2].map((k) => tip[k] - size * out[k] + u * side[k] + v * over[k]));
  return [line("tl-base", base, "Z"),
    path("", base.map((corner) => lines([tip, corner].map(flat))).join(""))];
}

// Makes a view rotatable; `grab(place, event)` may return a handler of the moves in place of that.
export function turnable(canvas, view, lowest, draw, grab = () => null) {
  function turn(azimuth, elevation) {
    view.azimuth += azimuth;
    view.elevation = clamp(view.elevation + elevation, [lowest, 90]);
    draw();
  }
  followDrag(canvas, (last, event) => grab(last, event) ?? ((now) => {
    turn((now[0] - last[0]) * 0.5, (now[1] - last[1]) * 0.4);
    last = now;
  }));
  fill(canvas, { tabindex: 0, onkeydown(event) {
    const [x, y] = ARROWS[event.key] ?? [];
    if (x === undefined || event.target !== canvas) return;
    turn(8 * x, 6 * y);
    event.preventDefault();
  } });
}

// Curves of points [x, y, rise] on the screen, in px, bent by `amount` of their largest rise.
export const bent = (curves, amount) =>
  curves.map((curve) => lines(curve.map(([x, y, rise]) => [x, y - amount * rise]))).join("");
