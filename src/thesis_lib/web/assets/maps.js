// Maps of signed values: one diverging scale centred on zero, axes in mm, a colour bar.
import { clamp, fixed, html, path, svg, text, ticks, ticksBelow } from "./parts.js";

// Colour of a value from a list of hexadecimal colours, the middle one for 0, the last for `most`.
export function colourOf(colormap, value, most) {
  const middle = colormap.length >> 1;
  return colormap[middle + clamp(Math.round((value / (most || 1)) * middle), [-middle, middle])];
}
export const channelsOf = (colour) => // red, green and blue up to 255
  [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));

// Number format for values up to `most`: very small and large ones in powers of ten of their unit.
export function scaleOf(most, unit) {
  const power = most > 0 ? Math.floor(Math.log10(most)) : 0, far = power < -2 || power > 3;
  const exponent = far ? 3 * Math.floor(power / 3) : 0;
  const raised = `${exponent}`.replace(/./g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)]);
  return { factor: 10 ** exponent, unit: far ? `× 10${raised} ${unit}` : unit,
    digits: clamp(3 - (power - exponent), [0, 4]) };
}
export const written = (value, { factor, unit, digits }) =>
  `${fixed(value / factor, digits)}\u00a0${unit}`;

// Axes to scale around a rectangle in mm. Returns the drawing, its scales, and the px per mm.
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

export function colourBar(colors, most, unit, words = "", least = -most) {
  const scale = scaleOf(most, unit), digits = Math.max(0, scale.digits - 1);
  const end = (value) => html("span", {}, fixed(value / scale.factor, value ? digits : 0));
  return html("div", { class: "tl-scale" }, html("span", {}, `${words} (${scale.unit})`), end(least),
    html("i", { style: `background: linear-gradient(90deg, ${colors})` }), end(most));
}

// Width in px of one of three maps in a row, or of `narrow` maps on a phone.
export const mapWidth = ({ wide, full }, narrow) =>
  Math.floor(wide ? (full - 2 * 28) / 3 : (full - (narrow - 1) * 12) / narrow);
