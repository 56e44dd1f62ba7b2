// What the small experiments of a page share: controls, panels that are drawn again when something changes, draws.
import { asked, keep } from "./address.js";
import { MARGIN, frame } from "./chart.js";
import { linkButton } from "./copy.js";
import {
  button, clamp, figure, fill, fixed, followDrag, followWidth, html, path, svg, text, ticks,
} from "./parts.js";
import { randomNumber } from "./physics.js";

export const rms = (values) => Math.sqrt(values.reduce((sum, value) => sum + value * value, 0) / values.length);

export function dice() { // numbers in [0, 1) that are the same on every visit
  let drawn = 0;
  return () => randomNumber(drawn += 1);
}

export function slider(words, [low, high], step, digits, unit, read, write) {
  const box = html("input", { type: "range", min: low, max: high, step }), shown = html("b");
  box.addEventListener("input", () => write(Number(box.value)));
  const node = html("label", { class: "tl-field tl-demo-slider" }, html("span", {}, `${words} `, shown), box);
  return { node, read, write, range: [low, high], key: words.toLowerCase().match(/[a-z]+/)[0], refresh() {
    box.value = read();
    shown.textContent = `${fixed(read(), digits)}${unit}`;
    fill(box, { "aria-valuetext": shown.textContent });
  } };
}
export const action = (words, onClick) => ({ node: button(words, { class: "tl-play" }, onClick), refresh() {} });

// An experiment in `el`: `controls` as above, figures by their letters, and `draw(figures, width)`, which returns what is said
// below and may ask for one more frame by `request`.
export function experiment(el, name, label, letters, build) {
  const status = html("p", { class: "tl-summary", role: "status" }), panels = {};
  for (const letter of letters) panels[letter] = figure(letter, svg("svg", { role: "img" }));
  let waiting = 0;
  const request = () => { waiting ||= requestAnimationFrame(refresh); };
  const { controls, draw, model } = build(request, panels), sliders = controls.filter(({ range }) => range);
  const nameOf = ({ key }) => `${name}-${key}`, usual = sliders.map(({ read }) => read()); // in the address, what is otherwise
  const link = linkButton(remember);
  function remember() {
    const others = sliders.filter(({ read }, i) => read() !== usual[i]);
    keep(sliders.map(nameOf), new URLSearchParams(others.map((one) => [nameOf(one), one.read()])));
  }
  for (const one of sliders) { // what is unknown or makes no sense is ignored
    const given = asked(nameOf(one)), value = Number(given || NaN);
    if (value === clamp(value, one.range)) one.write(value);
  }
  const root = html("section", { class: "tl-viewer tl-demo", "aria-label": label },
    html("div", { class: "tl-controls" }, ...controls.map(({ node }) => node), ...link),
    html("div", { class: "tl-grid" }, ...letters.map((letter) => panels[letter].node)), status);
  function refresh() {
    waiting = 0;
    root.classList.toggle("tl-wide", root.clientWidth > 640);
    controls.forEach((one) => one.refresh());
    status.textContent = draw(Object.fromEntries(letters.map((one) => [one, panels[one].canvas.clientWidth || 480])));
  }
  for (const event of ["change", "click", "pointerup"]) root.addEventListener(event, remember);
  root.demo = model; // for tests
  el.replaceChildren(root);
  refresh();
  const unfollow = followWidth(root, root, root.clientWidth, request);
  return () => { unfollow(); cancelAnimationFrame(waiting); };
}

// Words above a panel, and for screen readers.
export function headline({ canvas, caption }, words, more = "") {
  caption.textContent = words;
  fill(canvas, { "aria-label": `${words}. ${more}` });
}

// Axes with numbers on both sides; `frame` draws those of y.
export function axes(panel, width, across, up, xTitle, yTitle) {
  const { x, y, bottom } = frame(panel, width, across, up, xTitle, yTitle);
  panel.canvas.append(...ticks(...across, width < 420 ? 4 : 7).flatMap(([value, words]) =>
    [path("tl-axis", `M${x(value)} ${bottom}v5`), text(x(value), bottom + 18, words)]));
  return { x, y, bottom, right: width - MARGIN.right };
}

// Follow the pointer over a drawing: `take(x, y)` returns what its moves (x, y) then are told to.
export function drag(canvas, take) {
  const at = ({ clientX, clientY }) => {
    const box = canvas.getBoundingClientRect();
    return [clientX - box.left, clientY - box.top];
  };
  canvas.classList.add("tl-demo-drag");
  followDrag(canvas, (event) => {
    const move = take(...at(event));
    event.preventDefault();
    return (now) => move(...at(now));
  });
}
