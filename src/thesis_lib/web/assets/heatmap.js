// Maps of signed values: one diverging scale centred on zero, axes in mm, a colour bar.
import { fixed, html, path, svg, text, ticks } from "./parts.js";

const STEPS = 255; // odd: the middle one is zero

export function paletteOf(colors) { // STEPS triples of red, green and blue, interpolated between hex colours
  const known = colors.map((one) => [1, 3, 5].map((at) => parseInt(one.slice(at, at + 2), 16)));
  return Array.from({ length: STEPS }, (_, i) => {
    const at = (i / (STEPS - 1)) * (known.length - 1), low = Math.min(Math.floor(at), known.length - 2);
    return known[low].map((value, n) => Math.round(value + (known[low + 1][n] - value) * (at - low)));
  });
}
export const stepOf = (value, most) => Math.max(0, Math.min(STEPS - 1,
  Math.round((value / (most || 1)) * ((STEPS - 1) / 2)) + (STEPS - 1) / 2));
export const rgb = (triple) => `rgb(${triple.join(",")})`;
// Luminance decides whether what lies on a colour is drawn dark or light.
export const isDark = ([r, g, b]) => 0.3 * r + 0.59 * g + 0.11 * b < 128;

// How to write values up to `most`: very small and very large ones in powers of ten of their unit.
export function scaleOf(most, unit) {
  const power = most > 0 ? Math.floor(Math.log10(most)) : 0, far = power < -2 || power > 3;
  const exponent = far ? 3 * Math.floor(power / 3) : 0;
  const raised = String(exponent).replace(/./g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]);
  return { factor: 10 ** exponent, unit: far ? `× 10${raised} ${unit}` : unit,
    digits: Math.max(0, Math.min(4, 3 - (power - exponent))) };
}

// Axes to scale around a rectangle in mm. Returns the drawing, its scales, and how many px a mm has.
export function createMap(width, [left, right], [low, high], xTitle, yTitle) {
  const margin = { left: 36, right: 10, top: 20, bottom: 36 };
  const unit = (width - margin.left - margin.right) / (right - left);
  const bottom = margin.top + unit * (high - low), height = bottom + margin.bottom;
  const x = (v) => margin.left + unit * (v - left), y = (v) => bottom - unit * (v - low);
  const node = svg("svg", { width, height, viewBox: `0 0 ${width} ${height}` },
    text(2, 11, yTitle, "tl-muted", "start"), text(x(right), height - 4, xTitle, "tl-muted", "end"));
  const count = (size, each) => Math.max(3.5, Math.min(7, size / each));
  ticks(left, right, count(width - 46, 55)).forEach(([value, words]) => node.append(
    path("tl-axis", `M${x(value)} ${bottom}v4`), text(x(value), bottom + 17, words)));
  ticks(low, high, count(bottom - margin.top, 36)).forEach(([value, words]) => node.append(
    path("tl-axis", `M${margin.left - 4} ${y(value)}h4`),
    text(margin.left - 7, y(value) + 4, words, null, "end")));
  return { node, x, y, unit, bottom,
    frame: () => svg("rect", { class: "tl-frame", x: x(left), y: y(high), width: unit * (right - left),
      height: unit * (high - low) }) };
}

export function colourBar(id, palette, most, unit, words, width) {
  const scale = scaleOf(most, unit), end = width - 14, x = (v) => 14 + ((v + most) / (2 * most)) * (end - 14);
  const stops = palette.filter((_, i) => i % 2 === 0).map((triple, i, all) =>
    svg("stop", { offset: i / (all.length - 1), "stop-color": rgb(triple) }));
  const bar = svg("svg", { width, height: 30, viewBox: `0 0 ${width} 30`, "aria-hidden": "true" },
    svg("linearGradient", { id }, ...stops),
    svg("rect", { class: "tl-frame", x: 14, y: 1, width: end - 14, height: 10, fill: `url(#${id})` }));
  ticks(-most / scale.factor, most / scale.factor, Math.min(5, (end - 14) / 38)).forEach(([value, label]) => {
    const at = x(value * scale.factor);
    bar.append(path("tl-axis", `M${at} 11v4`), text(at, 26, label));
  });
  return html("div", { class: "tl-scale" }, html("span", {}, `${words} (${scale.unit})`), bar);
}

// Three maps in a row, or on a phone as many as `narrow` says; px.
export const mapWidth = ({ wide, full }, narrow) =>
  Math.floor(wide ? (full - 2 * 28) / 3 : (full - (narrow - 1) * 12) / narrow);
export const written = (value, { factor, unit, digits }) => `${fixed(value / factor, digits)}\u00a0${unit}`;
