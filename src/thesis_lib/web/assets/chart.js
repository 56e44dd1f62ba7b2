// Axes for curves and bars.
import { heightOf, isNumber, path, resize, text, ticks } from "./parts.js";

export const MARGIN = { left: 46, right: 14, top: 30, bottom: 44 };
// Over all settings, so that the scale stays while settings are compared.
export const extent = (rows) => [[0, 1e-6], ...rows].flat().filter(isNumber).reduce(
  ([low, high], value) => [Math.min(low, value), Math.max(high, value)], [0, 0]);

// Draws the axes in a panel and returns the scales.
export function frame(panel, width, [left, right], [low, high], xTitle, yTitle, room = 0) {
  const height = heightOf(width) + room, bottom = height - MARGIN.bottom - room;
  const top = high + (high - low) * 0.05, base = low < 0 ? low - (high - low) * 0.05 : 0;
  const x = (v) => MARGIN.left + ((v - left) / (right - left)) * (width - MARGIN.left - MARGIN.right);
  const y = (v) => bottom - ((v - base) / (top - base)) * (bottom - MARGIN.top);
  resize(panel, width, height).replaceChildren(text(2, 14, yTitle, "tl-muted", "start"),
    text(width - MARGIN.right, height - 6, xTitle, "tl-muted", "end"));
  ticks(base, top, 6).forEach(([value, words]) => panel.canvas.append(
    text(MARGIN.left - 7, y(value) + 4, words, null, "end"),
    path(value ? "tl-gridline" : "tl-axis", `M${MARGIN.left} ${y(value)}H${width - MARGIN.right}`)));
  return { x, y, bottom };
}
