// Shared parts: elements, numbers, marks, figures, pointer and width, URL, copy buttons.

// Each kind of structure registers its panels here, by the name in `structure.kind`: a function of
// (study) that returns {figures, draw()} and, if needed, highlight() and stop().
export const KINDS = {};

// --- elements
// Attributes, handlers and text, never markup: strings of the data cannot become elements. Lists
// of children are also appended; null, false and empty ones are omitted.
export function fill(node, attributes, ...children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name.slice(2), value);
    else if (value != null) node.setAttribute(name, value);
  }
  node.append(...children.flat(Infinity).filter((one) => one || one === 0));
  return node;
}
export const html = (tag, attributes = {}, ...children) =>
  fill(document.createElement(tag), attributes, ...children);
export const svg = (tag, attributes = {}, ...children) =>
  fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, ...children);
export const path = (cls, d, extra = {}) => svg("path", { class: cls, d, ...extra });
export const circle = (cls, cx, cy, r) => svg("circle", { class: cls, cx, cy, r });
export const text = (x, y, words, cls, anchor = "middle") =>
  svg("text", { x, y, class: cls, "text-anchor": anchor }, words);
export const xy = ([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`;
export const lines = (points, end = "") =>
  points.map((point, i) => `${i ? "L" : "M"}${xy(point)}`).join("") + end;
export const icon = (width, ...parts) =>
  svg("svg", { width, height: 14, viewBox: `0 0 ${width} 14`, "aria-hidden": "true" }, ...parts);

export const button = (words, attributes, onclick) =>
  html("button", { type: "button", ...attributes, onclick }, words);
export const options = (pairs) => pairs.map(([value, words]) => html("option", { value }, words));
// `pairs` are pairs of a value and its label.
export function select(pairs, attributes, onChange, value = null) {
  const onchange = ({ target }) => onChange(target.value);
  const node = html("select", { ...attributes, onchange }, options(pairs));
  if (value !== null) node.value = value;
  return node;
}
export function radios(legend, name, choices, onChange) { // a value, its label, and a smaller note
  const group = html("div", { class: "tl-modes" }, ...choices.map(([value, words, note = ""]) => {
    const names = { name, value, "data-testid": `${legend.toLowerCase()}-${value}` };
    const input = html("input", { type: "radio", ...names, onchange: () => onChange(value) });
    return html("label", {}, input, html("span", {}, words, html("small", {}, note)));
  }));
  return html("fieldset", { class: "tl-field" }, html("legend", {}, legend), group);
}
export const field = (label, node, attributes = {}) =>
  html("label", { class: "tl-field", ...attributes }, html("span", {}, label), node);

// --- numbers
export const isNumber = Number.isFinite; // false for other types
export const clamp = (value, [low, high]) => Math.max(low, Math.min(high, value));
export const fixed = (value, digits) => value.toFixed(digits).replace("-", "−");
const digitsOf = (value) =>
  3 - [99.5, 0.995, 0.095].filter((least) => Math.abs(value || 0.1) >= least).length;
export const show = (value) => (isNumber(value) ? fixed(value, digitsOf(value)) : "–");
export const percentInView = (share) => // 100 only if all are
  (share >= 1 ? "100" : fixed(Math.floor(1000 * share) / 10, 1));
export function range(low, high) {
  if (!isNumber(high)) return `at least ${show(low)} %`;
  if (!isNumber(low)) return `up to ${show(high)} %`;
  return `${low === high ? "" : `${fixed(low, digitsOf(high))}–`}${show(high)} %`;
}
export function ticks(low, high, count) { // pairs of value and text
  const rough = (high - low || 1) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power > rough * 0.999);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return Array.from({ length: last - first + 1 },
    (_, i) => [(first + i) * step, fixed((first + i) * step || 0, digits)]);
}

// Ticks with their numbers below an axis.
export const ticksBelow = (pairs, x, bottom) => pairs.flatMap(([value, words]) => [
  path("tl-axis", `M${x(value)} ${bottom}v4`), text(x(value), bottom + 17, words)]);

// --- marks of the settings differ in shape (null: a circle), too, not only in colour
const SHAPES = [null, [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
  [[0, -1.2], [1.1, 0.8], [-1.1, 0.8]], [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
  [[0, 1.2], [1.1, -0.8], [-1.1, -0.8]], [[-1.4, -0.5], [1.4, -0.5], [1.4, 0.5], [-1.4, 0.5]]];
export function mark(index, x, y, r) {
  const shape = SHAPES[index % SHAPES.length];
  if (shape) return lines(shape.map(([u, v]) => [x + u * r, y + v * r]), "Z");
  return `M${xy([x - r, y])}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
}
export const swatch = (i) => icon(14, path("tl-mark", mark(i, 7, 7, 4)));

// --- figures: a caption, the drawing, and a line below it
export function figure(letter, canvas, letters = letter) {
  const caption = html("span"), foot = html("div", { class: "tl-foot" });
  fill(canvas, { "data-testid": `panel-${letter}` });
  const heading = html("figcaption", {}, letters && [html("b", {}, letters), " "], caption);
  const names = { class: `tl-panel-${letter}`, style: `--area: ${letter}` };
  const node = html("figure", names, heading, canvas, foot);
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

// --- pointer and width
export const ARROWS = { // steps to the right and up
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
};

// Position of a pointer, in px from the corner of a box.
export const placeIn = ({ left, top }, { clientX, clientY }) => [clientX - left, clientY - top];
// When a pointer is pressed on a node, `take(place, event)` may return a function of the positions
// of its moves; `end` is called on release. Positions are in the node's box at the press.
export function followDrag(node, take, end = () => {}) {
  let move = null, box;
  node.classList.add("tl-drag");
  const release = () => {
    if (move) end();
    move = null;
  };
  fill(node, {
    onpointerdown(event) {
      if (event.button || move) return;
      box = node.getBoundingClientRect();
      move = take(placeIn(box, event), event) ?? null;
      if (move) node.setPointerCapture(event.pointerId);
    },
    onpointermove: (event) => move?.(placeIn(box, event)), onpointerup: release, onpointercancel: release,
  });
}

// Calls draw() when the width of a node changes; returns a function that stops this.
export function followWidth(node, draw) {
  let width = node.clientWidth;
  const observer = new ResizeObserver(() => requestAnimationFrame(() => {
    const before = width;
    width = node.clientWidth || before;
    if (width !== before) draw();
  }));
  observer.observe(node);
  return () => observer.disconnect();
}

// --- the URL of a page: its query holds the state, next to that of other parts
export const asked = (name) => new URLSearchParams(location.search).get(name);
// Writes values by name into it, in place of former ones; null ones are omitted.
export function keep(values, hash = location.hash, address = null) {
  const others = new URLSearchParams(location.search);
  Object.keys(values).forEach((name) => others.delete(name));
  const shown = Object.entries(values).filter(([, value]) => value !== null);
  const query = [address ?? new URLSearchParams(shown), others].filter(String).join("&");
  try {
    history.replaceState(history.state, "", `${query ? `?${query}` : location.pathname}${hash}`);
  } catch { /* some browsers refuse in a local file */ }
}

// --- copy buttons
// Without a clipboard, or permission, the text is shown in `node` and selected.
export function copyButton(words, label, textOf, node) {
  const names = { class: "tl-copy", "aria-label": label, "aria-live": "polite" };
  const made = button(words, names, async () => {
    const copied = textOf();
    try {
      await navigator.clipboard.writeText(copied);
      made.textContent = "Copied";
    } catch {
      node.textContent = copied;
      getSelection().selectAllChildren(node);
      made.textContent = "Selected: now copy it";
    }
    setTimeout(() => { made.textContent = words; }, 2500);
  });
  return made;
}
