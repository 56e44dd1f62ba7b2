// First frames of cameras: clicking the structure's corners in them gives lines of the manifest.
import { ARROWS, button, clamp, copyButton, fill, followDrag, html, path, placeIn, svg } from "./parts.js";

const PLACES = ["(0, 0)", "(length, 0)", "(length, width)", "(0, width)"];
const GRAB_RADIUS_PX = 20; // px of the screen within which a corner is grabbed: the precision of a finger
const LENS_ZOOM = 8, LENS_SIZE_PX = 272; // magnification, and side of the magnified part, px

// Whether four corners go around a convex quadrilateral, as the manifest requires.
function isConvex(points) {
  const turns = points.map((p, k) => {
    const q = points[(k + 1) % 4], r = points[(k + 2) % 4];
    return (q[0] - p[0]) * (r[1] - q[1]) - (q[1] - p[1]) * (r[0] - q[0]);
  });
  return turns.every((turn) => turn > 0) || turns.every((turn) => turn < 0);
}

const formatLine = ({ name, points }) =>
  `    corners_px: [${points.map(([u, v]) => `[${u.toFixed(1)}, ${v.toFixed(1)}]`).join(", ")}]  # ${name}`;

function camera({ name, size: [width, height], image, corners }, changed) {
  const own = { name, points: corners ?? [], done: () => own.points.length === 4 && isConvex(own.points) };
  const alt = `First frame of ${name}`;
  const picture = html("img", { src: image, width, height, alt, draggable: "false" });
  const outline = svg("polygon", {});
  const overlay = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" }, outline);
  const marks = PLACES.map((title, k) => button("", { title, "data-number": k + 1,
    "data-testid": `${name}-${k + 1}`,
    onfocus() { if (own.points[k]) { chosen = k; centre = own.points[k]; draw(); } },
    onkeydown(event) {
      const [x, y] = ARROWS[event.key] ?? [], by = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
      if (x === undefined) return;
      event.preventDefault();
      put(k, [own.points[k][0] + by * x, own.points[k][1] - by * y]);
    } }));
  const frame = html("div", { class: "tl-frame", "data-testid": `${name}-frame` }, picture, overlay, ...marks);
  const lens = svg("svg", { class: "tl-lens", role: "img", "data-testid": `${name}-lens`,
    "aria-label": `Magnified part of the first frame of ${name}` });
  const magnified = svg("image", { href: image, width, height });
  const cross = ([u, v], k) => path(k === chosen ? "tl-chosen" : "",
    `M${u + 0.5} ${v}h2.25M${u - 0.5} ${v}h-2.25M${u} ${v + 0.5}v2.25M${u} ${v - 0.5}v-2.25`);
  const says = html("p", { role: "status" });
  const add = button("Put the next corner into the middle", {}, () => {
    put(own.points.length, [width / 2, height / 2]);
    marks[chosen].focus();
  });
  const clear = button("Begin again", {}, () => {
    own.points.length = 0;
    chosen = 0;
    draw();
  });
  let chosen = 0, centre = own.points[0] ?? [width / 2, height / 2];

  function draw() {
    const count = own.points.length;
    marks.forEach((mark, k) => {
      mark.hidden = k >= count;
      if (k >= count) return;
      const [u, v] = own.points[k];
      mark.style.left = `${(100 * u) / width}%`;
      mark.style.top = `${(100 * v) / height}%`;
      mark.setAttribute("aria-label", `Corner ${k + 1} at ${PLACES[k]}: ${u.toFixed(1)}, ${v.toFixed(1)} px`);
      mark.classList.toggle("tl-chosen", k === chosen);
    });
    lens.replaceChildren(magnified, ...own.points.map(cross));
    outline.setAttribute("points", own.points.map((point) => point.join(",")).join(" "));
    outline.classList.toggle("tl-wrong", count === 4 && !own.done());
    says.textContent = count < 4 ? `Click corner ${count + 1}, at ${PLACES[count]}.`
      : own.done() ? "All four corners. Drag one, here or magnified, to correct it."
      : "The sides cross: the corners are not in their order around the structure.";
    add.disabled = count === 4;
    magnify();
    changed();
  }
  function magnify() { // the surroundings of the current place
    const side = LENS_SIZE_PX / LENS_ZOOM, corner = centre.map((value) => value - side / 2);
    fill(lens, { viewBox: [...corner, side, side].join(" ") });
  }
  function put(k, [u, v], follow = true) { // limited to the image
    own.points[k] = [clamp(u, [0, width]), clamp(v, [0, height])];
    chosen = k;
    if (follow) centre = own.points[k];
    draw();
  }
  function release() {
    if (!own.points[chosen]) return;
    centre = own.points[chosen];
    magnify();
    marks[chosen].focus();
  }
  const scale = () => width / picture.getBoundingClientRect().width;
  const at = (place) => place.map((px) => px * scale());
  followDrag(frame, (place, event) => {
    event.preventDefault();
    const p = at(place), far = ([u, v]) => Math.hypot(u - p[0], v - p[1]);
    let k = own.points.length;
    if (k < 4) put(k, p); // corners of a narrow structure are near each other: none is grabbed yet
    else k = own.points.reduce((best, point, i) => (far(point) < far(own.points[best]) ? i : best), 0);
    if (far(own.points[k]) > GRAB_RADIUS_PX * scale()) return null;
    const off = own.points[k].map((value, i) => value - p[i]);
    put(k, own.points[k]);
    return (moved) => put(k, at(moved).map((value, i) => value + off[i]));
  }, release);
  frame.addEventListener("pointermove", (event) => {
    if (event.buttons || event.pointerType === "touch") return;
    centre = at(placeIn(frame.getBoundingClientRect(), event));
    magnify();
  });
  frame.addEventListener("pointerleave", () => { centre = own.points[chosen] ?? centre; magnify(); });
  followDrag(lens, (down, event) => {
    event.preventDefault();
    if (!own.points[chosen]) return null;
    const still = centre;
    const to = (place) =>
      put(chosen, place.map((px, i) => still[i] + (px - LENS_SIZE_PX / 2 - 1) / LENS_ZOOM), false);
    to(down);
    return to;
  }, release);
  own.node = html("section", {}, html("h2", {}, name), frame,
    html("div", { class: "tl-under" }, lens, html("div", {}, says, add, clear)));
  own.draw = draw;
  return own;
}

function render({ model, el }) {
  const all = [], place = html("pre", { tabindex: "0", "data-testid": "lines" });
  const left = html("p", { role: "status" });
  const text = () => all.filter((one) => one.done()).map(formatLine).join("\n");
  function changed() {
    const lacking = all.filter((one) => !one.done()).map((one) => one.name);
    place.textContent = text();
    left.textContent = lacking.length ? `Corners are still wanted of ${lacking.join(", ")}.` : "";
  }
  all.push(...model.get("cameras").map((one) => camera(one, changed)));
  el.classList.add("tl-corners");
  el.append(...all.map((one) => one.node),
    html("h2", {}, "Lines for the manifest"), left, place,
    html("p", {}, copyButton("Copy", "Copy the lines", text, place)));
  all.forEach((one) => one.draw());
}
export default { render };
