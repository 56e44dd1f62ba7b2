// The sound field of a measured shape on the planes above it, playing.
// Front end of thesis_lib.measure.radiation.report in the form that static_html runs.
import { amplitude, coloursOf, createPressure, createPlane, decode } from "./field.js";
import { colourBar, paletteOf } from "./heatmap.js";
import { createMotion } from "./motion.js";
import { figure, followWidth, html } from "./parts.js";

function render({ model, el }) {
  const { planes, fields, halves, frequency, colormap, words } = model.get("data");
  const panel = figure("b", html("div", { class: "tl-maps" }), "");
  const palette = paletteOf(colormap), colours = coloursOf(palette), decoded = fields.map(decode);
  const most = Math.max(...decoded.map(amplitude)) || 1;
  let shown = [], width = 0;
  const motion = createMotion((phase) => {
    for (const one of shown) one.paint(colours, Math.cos(phase), Math.sin(phase));
  }, false); // a sound plays only when it is asked to
  const root = html("section", { class: "tl-viewer tl-radiated", "aria-label": "The sound field", "data-testid": "radiated" },
    html("p", { class: "tl-summary" }, words), panel.node, motion.node);
  function draw() {
    const wide = width >= 560 ? Math.floor((width - 28) / 2) : width;
    shown = [];
    panel.canvas.replaceChildren(...planes.map((plane, i) => {
      const picture = createPlane(wide, plane, halves[i]), names = { "aria-label": `pressure on ${plane.name}` };
      const one = createPressure(decoded[i], most, plane.shape, names);
      shown.push(one);
      picture.put(one.canvas);
      return html("div", { class: "tl-map" }, html("p", { class: "tl-maphead" }, `${plane.name} plane`), picture.node);
    }), colourBar("tl-radiated-scale", palette, most, "Pa", "pressure", Math.min(width, 260)));
    motion.redraw();
  }
  motion.at(frequency);
  motion.watch(panel.node);
  el.replaceChildren(root);
  width = Math.round(panel.node.clientWidth) || 480;
  draw();
  const unfollow = followWidth(root, panel.node, width, (now) => { width = now; draw(); });
  return () => { unfollow(); motion.stop(); };
}

export default { render };
