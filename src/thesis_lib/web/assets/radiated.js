// The animated sound field of a measured shape. Front end of thesis_lib.measure.report.build.
import { amplitude, createPressure, decode, playFields } from "./field.js";
import { colourBar } from "./maps.js";
import { figure, followWidth, html } from "./parts.js";

function render({ model, el }) {
  const { planes, fields, halves, frequency, colormap, words } = model.get("data");
  const panel = figure("b", html("div", { class: "tl-maps" }), "");
  const decoded = fields.map(decode), most = Math.max(...decoded.map(amplitude)) || 1;
  const shown = [], motion = playFields(shown, colormap);
  const names = { "aria-label": "The sound field", "data-testid": "radiated" };
  const root = html("section", { class: "tl-viewer tl-radiated", ...names },
    html("p", { class: "tl-summary" }, words), panel.node, motion.node);
  function draw() {
    const width = panel.node.clientWidth || 480;
    const wide = width >= 560 ? Math.floor((width - 28) / 2) : width;
    shown.splice(0, Infinity, ...planes.map((plane, i) =>
      createPressure(wide, plane, halves[i], decoded[i], most, `${plane.name} plane`,
        { "aria-label": `pressure on ${plane.name}` })));
    panel.canvas.replaceChildren(...shown.map(({ element }) => element),
      colourBar(colormap, most, "Pa", "pressure"));
    motion.redraw();
  }
  motion.at(frequency);
  motion.watch(panel.node);
  el.replaceChildren(root);
  draw();
  followWidth(panel.node, draw);
}

export default { render };
