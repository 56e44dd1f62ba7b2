// Space as every sketch shows it: vectors, cameras as pyramids, and turning by pointer and arrow keys.
import { fill } from "./parts.js";

// World frame: X along the structure, Y across, Z up; azimuth from +Y towards +X, elevation from XY.
export const RAD = Math.PI / 180;
export const direction = (azimuth, elevation) => [Math.cos(elevation * RAD) * Math.sin(azimuth * RAD),
  Math.cos(elevation * RAD) * Math.cos(azimuth * RAD), Math.sin(elevation * RAD)];
export const sideways = (azimuth) => [-Math.cos(azimuth * RAD), Math.sin(azimuth * RAD), 0];
export const times = (v, k) => v.map((c) => c * k);
export const plus = (u, v) => u.map((c, i) => c + v[i]);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const trace = (point, steps = 72) => Array.from({ length: steps + 1 }, (_, i) => point(i / steps));
export const SQUARE = [[-1, -1], [1, -1], [1, 1], [-1, 1]];

// How a view shows space: the direction to the viewer, and where a place is on the screen.
export function orbit(view, unit, [x, y]) {
  const viewer = direction(view.azimuth, view.elevation), right = sideways(view.azimuth), up = cross(viewer, right);
  return { viewer, flat: (v) => [x + unit * dot(v, right), y - unit * dot(v, up)] };
}

// The base of a camera's pyramid, before the tip and towards what it looks at; its long sides are level.
export function baseOf(tip, azimuth, elevation, size) {
  const out = direction(azimuth, elevation), side = times(sideways(azimuth), size * 0.5);
  const over = times(cross(side, out), 0.56), centre = plus(tip, times(out, -size));
  return SQUARE.map(([u, v]) => plus(centre, plus(times(side, u), times(over, v))));
}

export function turnable(canvas, view, lowest, draw) {
  let dragged;
  function rotate(event, azimuth, elevation) {
    view.azimuth += azimuth;
    view.elevation = Math.max(lowest, Math.min(90, view.elevation + elevation));
    event.preventDefault();
    draw();
  }
  canvas.addEventListener("pointerdown", (event) => {
    dragged = event;
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    if (!canvas.hasPointerCapture(event.pointerId)) return;
    rotate(event, (event.clientX - dragged.clientX) * 0.5, (event.clientY - dragged.clientY) * 0.4);
    dragged = event;
  });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, 6], ArrowDown: [0, -6] }[event.key];
    if (step) rotate(event, ...step);
  });
  fill(canvas, { tabindex: 0 });
}
