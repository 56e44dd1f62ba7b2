// A slowed period of vibration that plays, pauses and is set by hand, and its image in one camera.
import { button, fill, html, icon, options, path, select, show } from "./parts.js";
import { inView, pixelate, project } from "./pinhole.js";

const PERIOD_MS = 2400; // ms, of a period on the screen

// Calls the functions `draws` with the phase in rad, in each frame while it plays and is visible.
// It starts by itself if `unasked`, unless reduced motion is preferred; in print the phase is 0.
export function createMotion(draws, unasked = true) {
  const [still, print] = ["(prefers-reduced-motion: reduce)", "print"].map((one) => matchMedia(one));
  const player = button("", { class: "tl-play", "data-testid": "play" }, () => play(!wanted));
  const slider = html("input", { type: "range", min: 0, max: 360, value: 0, "data-testid": "phase",
    oninput() { play(false); put(Number(slider.value)); }, "aria-valuetext": "0°" });
  const visible = new Set(), degrees = html("span", { "aria-hidden": "true" }, "0°");
  const slowed = html("span", { class: "tl-slowed" });
  const node = html("div", { class: "tl-time" }, player,
    html("div", { class: "tl-phase" }, html("label", {}, "phase ωt", slider), degrees), slowed);
  let phase = 0, wanted = false, frame = 0; // degrees

  const redraw = () => draws.forEach((draw) => draw((phase * Math.PI) / 180));
  function put(angle) {
    phase = angle;
    slider.value = Math.round(phase);
    degrees.textContent = `${slider.value}°`;
    slider.setAttribute("aria-valuetext", degrees.textContent);
    redraw();
  }
  function step(now, before) { // while it is wanted and visible
    const on = wanted && node.isConnected && visible.size > 0 && !print.matches;
    if (on) put((phase + ((now - before) / PERIOD_MS) * 360) % 360);
    frame = on ? requestAnimationFrame((next) => step(next, now)) : 0;
  }
  const follow = () => { frame ||= requestAnimationFrame((start) => step(start, start)); };
  function play(on) {
    wanted = on;
    player.replaceChildren(icon(14, path("tl-sign", on ? "M3 2V12M10 2V12" : "M3 1V13L12 7Z")),
      on ? "Pause" : "Play");
    follow();
  }
  const ended = new AbortController(), { signal } = ended;
  const observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) visible[isIntersecting ? "add" : "delete"](target);
    follow();
  });
  still.addEventListener("change", () => { if (still.matches) play(false); }, { signal });
  print.addEventListener("change", () => { follow(); if (print.matches) put(0); }, { signal });
  play(unasked && !still.matches);
  return {
    node, put, redraw,
    watch: (...nodes) => [node, ...nodes].forEach((one) => observer.observe(one)), // while visible
    at(hertz) { slowed.textContent = hertz ? `slowed ${show((hertz * PERIOD_MS) / 1000)} times` : ""; },
    stop() {
      play(false);
      observer.disconnect();
      ended.abort();
    },
  };
}

// The image of one of several cameras: the whole pixel of each marker, now and at rest.
export function createImage() {
  const WIDTH = 320, HEIGHT = 180;
  const canvas = html("canvas", { width: WIDTH, height: HEIGHT, role: "img" });
  const box = select([], { "data-testid": "camera" }, () => { tell(); draw(); });
  const words = html("p", { class: "tl-foot" }), label = html("label", {}, "Image of camera", box);
  const names = { class: "tl-panel-m", style: "--area: m", "data-testid": "image" };
  const node = html("figure", names, html("figcaption", {}, label), canvas, words);
  const context = canvas.getContext("2d");
  let P, rest, moved, size, shifts, name, phase = 0, seen = null;

  const imagesOf = (points) => project(P.subarray(12 * box.value, 12 * box.value + 12), points, shifts);
  const instant = (amount) => // pixels of the markers, u of all, then v of all
    pixelate(imagesOf(rest.map((value, i) => value + amount * (moved[i] - value))));
  function paint(pixels, colour) {
    const count = pixels.length / 2, scale = Math.min(WIDTH / size[0], HEIGHT / size[1]);
    const [left, top] = [(WIDTH - scale * size[0]) / 2, (HEIGHT - scale * size[1]) / 2];
    context.fillStyle = colour;
    for (let i = 0; i < count; i += 1) {
      const u = pixels[i], v = pixels[count + i];
      if (u >= 0 && v >= 0 && u < size[0] && v < size[1])
        context.fillRect(Math.floor(left + scale * u) - 1, Math.floor(top + scale * v) - 1, 3, 3);
    }
  }
  function draw() {
    seen = instant(Math.cos(phase));
    context.fillStyle = "#15181d";
    context.fillRect(0, 0, WIDTH, HEIGHT);
    paint(instant(0), "#5c6675");
    paint(seen, "#ffd24a");
  }
  function tell() {
    const before = imagesOf(rest), after = imagesOf(moved), count = before.length / 2;
    const motion = Math.max(...Array.from({ length: count }, (_, i) =>
      Math.hypot(after[i] - before[i], after[count + i] - before[count + i])));
    const outside = Math.round(count * (1 - inView(after, size, 1)));
    words.textContent = `${name}${size.join(" × ")} pixels; markers move by up to ${show(motion)} px ` +
      "from rest (grey) and are read in whole pixels." +
      (outside ? ` ${outside} of ${count} markers are out of view.` : "");
    fill(canvas, { "aria-label": `Image of camera ${Number(box.value) + 1}: ${words.textContent}` });
    label.dataset.chosen = box.selectedOptions[0].text; // for print
  }
  return {
    node, pixels: () => Array.from(seen),
    // Projection matrices, size in px, points at rest and deflected, offset in px, setting's name.
    load(cameras, sensor, markers, deflected, offset = 0, whose = "") {
      [P, size, rest, moved, shifts] = [cameras, sensor, markers, deflected, [offset, offset]];
      name = whose && `${whose}: `;
      const count = P.length / 12, before = Math.max(0, Math.min(count - 1, Number(box.value)));
      if (box.length !== count) box.replaceChildren(
        ...options(Array.from({ length: count }, (_, i) => [i, `${i + 1} of ${count}`])));
      box.value = before;
      tell();
      draw();
    },
    show(angle) { phase = angle; if (P) draw(); },
  };
}
