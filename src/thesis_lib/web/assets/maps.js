// Maps of signed values: one diverging scale centred on zero, axes in mm, a colour bar.
import { clamp, fixed, html, path, svg, text, ticks, ticksBelow } from "./parts.js";

export const MIDDLE = 127;
const STEPS = 255; // odd: the middle one is zero

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
    ticksBelow(ticks(left, right, count(width - 46, 55)), x, bottom),
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
  const numbers = ticks(-limit, limit, Math.min(5, long / 38));
  const at = (value) => first + ((value / limit + 1) / 2) * long;
  return html("div", { class: "tl-scale" }, html("span", {}, `${words} (${scale.unit})`),
    svg("svg", { width, height: 30, viewBox: `0 0 ${width} 30`, "aria-hidden": "true" },
      svg("linearGradient", { id }, ...stops),
      svg("rect", { class: "tl-frame", ...box, fill: `url(#${id})` }),
      ticksBelow(numbers, at, box.y + box.height)));
}

// Three maps in a row, or on a phone as many as `narrow` says; px.
export const mapWidth = ({ wide, full }, narrow) =>
  Math.floor(wide ? (full - 2 * 28) / 3 : (full - (narrow - 1) * 12) / narrow);
