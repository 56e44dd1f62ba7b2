// Axes of curves and bars.
import { heightOf, isNumber, path, resize, text, ticks, ticksBelow } from "./parts.js";

export const MARGIN = { left: 46, right: 14, top: 30, bottom: 44 };
// Range over all settings, so that the scale stays while settings are compared.
export const extent = (rows) => [[0, 1e-6], ...rows].flat().filter(isNumber).reduce(
  ([low, high], value) => [Math.min(low, value), Math.max(high, value)], [0, 0]);

// Range from the least value, if all are positive and the largest is more than 20 times as large.
export function spread(rows) {
  const [, high] = extent(rows), low = Math.min(...rows.flat().filter(isNumber));
  return [low > 0 && high > 20 * low ? low : 0, high];
}

function decades(low, high) { // 1, 2, 5, 10, …; only powers of ten if there are many
  const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high));
  const steps = last - first > 3 ? [1] : [1, 2, 5];
  return Array.from({ length: last - first + 1 }, (_, i) => steps.map((one) => one * 10 ** (first + i)))
    .flat().filter((v) => v >= low && v <= high).map((v) => [v, `${Number(v.toPrecision(1))}`]);
}

// Draws axes in a panel and returns the scales; y is logarithmic if it begins above 0.
// They have about `columns` and `rows` numbers, and `room` px more below them.
export function axes(panel, width, [left, right], [low, high], xTitle, yTitle, more = {}) {
  const { height = heightOf(width), margin = MARGIN, columns = 6, rows = 6, room = 0 } = more;
  const bottom = height - margin.bottom, log = low > 0, at = log ? Math.log : (v) => v;
  const top = log ? high * 1.3 : high + (high - low) * 0.05;
  const base = log ? low / 1.5 : low < 0 ? low - (high - low) * 0.05 : 0;
  const end = width - margin.right, last = height + room;
  const x = (v) => margin.left + ((v - left) / (right - left)) * (end - margin.left);
  const share = (v) => (at(log ? Math.max(v, base) : v) - at(base)) / (at(top) - at(base));
  const y = (v) => bottom - share(v) * (bottom - margin.top);
  resize(panel, width, last).replaceChildren(text(2, 14, yTitle, "tl-muted", "start"),
    text(end, margin.title ?? last - 6, xTitle, "tl-muted", "end"),
    ...(log ? decades(base, top) : ticks(base, top, rows)).flatMap(([value, words]) => [
      text(margin.left - 7, y(value) + 4, words, null, "end"),
      path(value ? "tl-gridline" : "tl-axis", `M${margin.left} ${y(value)}H${end}`)]),
    ...(columns ? ticksBelow(ticks(left, right, columns), x, bottom) : []));
  return { x, y, bottom, right: end };
}
