// Maps of signed values, on one diverging scale centred on zero: axes in mm, a colour bar, and
// sound fields on a plane at any instant of the period.
import { clamp, fixed, html, path, svg, text, ticks } from "./parts.js";

const STEPS = 255, MIDDLE = 127; // odd: the middle one is zero

export function paletteOf(colors) { // STEPS triples of red, green and blue between hex colours
  const known = colors.map((one) => [1, 3, 5].map((at) => parseInt(one.slice(at, at + 2), 16)));
  return Array.from({ length: STEPS }, (_, i) => {
    const at = (i / (STEPS - 1)) * (known.length - 1);
    const low = Math.min(Math.floor(at), known.length - 2), next = known[low + 1];
    return known[low].map((value, n) => Math.round(value + (next[n] - value) * (at - low)));
  });
}
export const stepOf = (value, most) =>
  clamp(MIDDLE + Math.round((value / (most || 1)) * MIDDLE), [0, STEPS - 1]);
export const rgb = (triple) => `rgb(${triple.join(",")})`;
// Luminance decides whether what lies on a colour is drawn dark or light.
export const isDark = ([r, g, b]) => 0.3 * r + 0.59 * g + 0.11 * b < 128;

// How to write values up to `most`: very small and very large ones in powers of ten of their unit.
export function scaleOf(most, unit) {
  const power = most > 0 ? Math.floor(Math.log10(most)) : 0, far = power < -2 || power > 3;
  const exponent = far ? 3 * Math.floor(power / 3) : 0;
  const raised = `${exponent}`.replace(/./g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]);
  return { factor: 10 ** exponent, unit: far ? `× 10${raised} ${unit}` : unit,
    digits: clamp(3 - (power - exponent), [0, 4]) };
}
export const written = (value, { factor, unit, digits }) =>
  `${fixed(value / factor, digits)}\u00a0${unit}`;

// Axes to scale around a rectangle in mm. Returns the drawing, its scales, and how many px a mm has.
export function createMap(width, [left, right], [low, high], xTitle, yTitle) {
  const margin = { left: 36, right: 10, top: 20, bottom: 36 };
  const unit = (width - margin.left - margin.right) / (right - left);
  const bottom = margin.top + unit * (high - low), height = bottom + margin.bottom;
  const x = (v) => margin.left + unit * (v - left), y = (v) => bottom - unit * (v - low);
  const count = (size, each) => clamp(size / each, [3.5, 7]);
  const node = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}` },
    text(2, 11, yTitle, "tl-muted", "start"), text(x(right), height - 4, xTitle, "tl-muted", "end"),
    ...ticks(left, right, count(width - 46, 55)).flatMap(([value, words]) => [
      path("tl-axis", `M${x(value)} ${bottom}v4`), text(x(value), bottom + 17, words)]),
    ...ticks(low, high, count(bottom - margin.top, 36)).flatMap(([value, words]) => [
      path("tl-axis", `M${margin.left - 4} ${y(value)}h4`),
      text(margin.left - 7, y(value) + 4, words, null, "end")]));
  const frame = () => svg("rect", { class: "tl-frame", x: x(left), y: y(high),
    width: unit * (right - left), height: unit * (high - low) });
  return { node, x, y, unit, frame };
}

export function colourBar(id, palette, most, unit, words, width) {
  const scale = scaleOf(most, unit), first = 14, end = width - 14, long = end - first;
  const stops = palette.filter((_, i) => i % 2 === 0).map((triple, i, all) =>
    svg("stop", { offset: i / (all.length - 1), "stop-color": rgb(triple) }));
  const box = { x: first, y: 1, width: long, height: 10 }, limit = most / scale.factor;
  const numbers = ticks(-limit, limit, Math.min(5, long / 38)).flatMap(([value, label]) => {
    const at = first + ((value / limit + 1) / 2) * long;
    return [path("tl-axis", `M${at} 11v4`), text(at, 26, label)];
  });
  return html("div", { class: "tl-scale" }, html("span", {}, `${words} (${scale.unit})`),
    svg("svg", { width, height: 30, viewBox: `0 0 ${width} 30`, "aria-hidden": "true" },
      svg("linearGradient", { id }, ...stops),
      svg("rect", { class: "tl-frame", ...box, fill: `url(#${id})` }), ...numbers));
}

// Three maps in a row, or on a phone as many as `narrow` says; px.
export const mapWidth = ({ wide, full }, narrow) =>
  Math.floor(wide ? (full - 2 * 28) / 3 : (full - (narrow - 1) * 12) / narrow);

// --- sound fields: complex pressures at the points of a plane, u-major
export function decode({ scale, re, im }) {
  const numbers = (code) => Int8Array.from(atob(code), (sign) => sign.charCodeAt(0));
  return { scale: scale / 127, re: numbers(re), im: numbers(im) };
}
export const amplitude = (field) => (field ? field.scale * field.re.reduce(
  (most, re, n) => Math.max(most, Math.hypot(re, field.im[n])), 0) : 0);
export const coloursOf = (palette) => Uint32Array.from(palette,
  ([red, green, blue]) => (255 << 24) | (blue << 16) | (green << 8) | red);

// A plane with axes in mm over a structure that reaches as far as `half`, and on it its field, or
// the words of why there is none. Returns the element and what paints an instant of the field on a
// scale that ends at `most`.
export function createPressure(width, plane, half, field, most, heading, names, words) {
  const { u_mm: [u0, u1], z_mm: [z0, z1], shape: [nu, nz], name } = plane;
  const du = (u1 - u0) / (nu - 1) / 2, dz = (z1 - z0) / (nz - 1) / 2; // a pixel around each point
  const { node, x, y, unit, frame } =
    createMap(width, [u0 - du, u1 + du], [0, z1 + dz], `${name[0]} (mm)`, "Z (mm)");
  node.append(frame(), path("tl-slab", `M${x(-half)} ${y(0)}H${x(half)}`));
  const size = { left: x(u0 - du), top: y(z1 + dz), width: unit * (u1 - u0 + 2 * du),
    height: unit * (z1 - z0 + 2 * dz) };
  const style = Object.entries(size).map(([key, value]) => `${key}: ${value}px`).join("; ");
  const shown = field
    ? html("canvas", { width: nu, height: nz, role: "img", style, ...names })
    : html("div", { class: "tl-nodal-note", style, ...names }, words);
  const element = html("div", { class: "tl-map" }, html("p", { class: "tl-maphead" }, heading),
    html("div", { class: "tl-picture" }, node, shown));
  if (!field) return { element, paint() {} };
  const context = shown.getContext("2d"), image = context.createImageData(nu, nz);
  const pixels = new Uint32Array(image.data.buffer), { scale, re, im } = field;
  return { element, paint(colours, cos, sin) {
    const factor = (scale * MIDDLE) / most;
    for (let iz = nz - 1, at = 0; iz >= 0; iz--) for (let iu = 0; iu < nu; iu++, at++) { // from the top
      const n = iu * nz + iz, step = Math.round(MIDDLE + factor * (re[n] * cos - im[n] * sin));
      pixels[at] = colours[Math.max(0, Math.min(2 * MIDDLE, step))];
    }
    context.putImageData(image, 0, 0);
  } };
}
