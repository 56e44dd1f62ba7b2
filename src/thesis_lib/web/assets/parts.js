// Small pieces that every panel uses: elements, numbers as text, marks of the settings, figures.

// Each kind of structure registers its own panels here, by the name in `structure.kind`: a function of
// (study, uid) that returns {figures, draw(), highlight(), stop()}.
export const KINDS = {};

// Attributes and text only, never markup: strings of the data cannot become elements.
export function fill(node, attributes, children = []) {
  for (const [name, value] of Object.entries(attributes)) if (value != null) node.setAttribute(name, value);
  node.append(...children);
  return node;
}
export const html = (tag, attributes = {}, ...children) =>
  fill(document.createElement(tag), attributes, children);
export const svg = (tag, attributes = {}, ...children) =>
  fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
export const path = (cls, d, extra = {}) => svg("path", { class: cls, d, ...extra });
export const text = (x, y, words, cls, anchor = "middle") =>
  svg("text", { x, y, class: cls, "text-anchor": anchor }, words);
export const lines = (points, end = "") =>
  points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("") + end;
export const icon = (width, ...parts) =>
  svg("svg", { width, height: 14, viewBox: `0 0 ${width} 14`, "aria-hidden": "true" }, ...parts);

export function button(words, attributes, onClick) {
  const node = html("button", { type: "button", ...attributes }, words);
  node.addEventListener("click", onClick);
  return node;
}
export const options = (pairs) => pairs.map(([value, words]) => html("option", { value }, words));
export function select(pairs, attributes, onChange) { // of pairs of a value and its words
  const node = html("select", attributes, ...options(pairs));
  node.addEventListener("change", () => onChange(node.value));
  return node;
}
// One of a few, side by side: a value, its words, and a smaller note.
export function radios(legend, name, choices, onChange) {
  const group = html("div", { class: "tl-modes" }, ...choices.map(([value, words, note = ""]) => {
    const testid = `${legend.toLowerCase()}-${value}`;
    const input = html("input", { type: "radio", name, value, "data-testid": testid });
    input.addEventListener("change", () => onChange(value));
    return html("label", {}, input, html("span", {}, words, html("small", {}, note)));
  }));
  return html("fieldset", { class: "tl-field" }, html("legend", {}, legend), group);
}
export const field = (label, node, attributes = {}) =>
  html("label", { class: "tl-field", ...attributes }, html("span", {}, label), node);

// Numbers
export const isNumber = (value) => typeof value === "number" && Number.isFinite(value);
export const clamp = (value, [low, high]) => Math.max(low, Math.min(high, value));
export const fixed = (value, digits) => value.toFixed(digits).replace("-", "−");
const digitsOf = (value) => (Math.abs(value) >= 99.5 ? 0 : Math.abs(value) >= 0.995 ? 1 : Math.abs(value) >= 0.095 || !value ? 2 : 3);
export const show = (value) => (isNumber(value) ? fixed(value, digitsOf(value)) : "–");
export function range(low, high) {
  if (isNumber(low) && isNumber(high) && low !== high) return `${fixed(low, digitsOf(high))}–${show(high)} %`;
  return isNumber(high) ? `${isNumber(low) ? "" : "up to "}${show(high)} %` : `at least ${show(low)} %`;
}
export function ticks(low, high, count) { // pairs of a value and its text
  const rough = (high - low || 1) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power > rough * 0.999);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: last - first + 1 },
    (_, i) => [(first + i) * step, fixed((first + i) * step || 0, digits)]);
}

// One marker shape per setting (null: a circle), so that colour is never the only difference.
const SHAPES = [null, [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
  [[0, -1.2], [1.1, 0.8], [-1.1, 0.8]], [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
  [[0, 1.2], [1.1, -0.8], [-1.1, -0.8]], [[-1.4, -0.5], [1.4, -0.5], [1.4, 0.5], [-1.4, 0.5]]];
export function mark(index, x, y, r) {
  const shape = SHAPES[index % SHAPES.length];
  if (shape) return lines(shape.map(([u, v]) => [x + u * r, y + v * r]), "Z");
  return `M${(x - r).toFixed(1)} ${y.toFixed(1)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
}

export const swatch = (i) => icon(14, path("tl-mark", mark(i, 7, 7, 4)));

// A figure: caption, what is drawn, and a line below it.
export function figure(letter, canvas, letters = letter) {
  const caption = html("span"), foot = html("div", { class: "tl-foot" });
  fill(canvas, { "data-testid": `panel-${letter}` });
  const heading = html("figcaption", {}, ...(letters ? [html("b", {}, letters)] : []), caption);
  const node = html("figure", { class: `tl-panel-${letter}` }, heading, canvas, foot);
  return { node, canvas, caption, foot };
}
export function entitle({ canvas, caption }, study, role, words, strong = "", help = "") {
  caption.replaceChildren(words, html("strong", {}, strong));
  const place = `case ${study.case().name}, mode ${study.mode().mode}`;
  fill(canvas, { role, "aria-label": `${words}${strong}, ${place}. ${help}` });
}
export const heightOf = (width) => (width < 420 ? 270 : 310);
export const resize = ({ canvas }, width, height) =>
  fill(canvas, { viewBox: `0 0 ${width} ${height}`, height });

// While a pointer is down on a node: `take(event)` returns what is called on its moves, if anything,
// and `end` is called when it is let go.
export function followDrag(node, take, end = () => {}) {
  let move = null;
  node.addEventListener("pointerdown", (event) => {
    if (event.button || move) return;
    move = take(event) ?? null;
    if (move) node.setPointerCapture(event.pointerId);
  });
  node.addEventListener("pointermove", (event) => move?.(event));
  for (const name of ["pointerup", "pointercancel"]) node.addEventListener(name, () => {
    if (move) end();
    move = null;
  });
}

// Calls draw(width) when a node's width in px is no longer `width`; returns what ends that.
export function followWidth(root, node, width, draw) {
  const observer = new ResizeObserver(() => requestAnimationFrame(() => {
    const now = Math.round(node.clientWidth) || width;
    if (now !== width) draw((width = now));
  }));
  observer.observe(root);
  return () => observer.disconnect();
}
