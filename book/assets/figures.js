// Figures grow: a click, a tap or the button beside them opens them as large as the window.
(() => {
  const { element, button, dialog } = window.thesisBook;
  const LEAST = 1, MOST = 12, STEP = 1.4;
  let open = null;

  const make = () => {
    const box = dialog("tl-zoom", "Figure"), picture = element("img", ""), view = element("div", "tl-zoom-view", picture);
    const caption = element("p", "tl-zoom-caption");
    let scale = 1, ratio = 1;
    // Sizes, not transforms: drawings are drawn again at each size, and so stay sharp.
    const zoom = (to, x = view.clientWidth / 2, y = view.clientHeight / 2) => {
      const next = Math.min(MOST, Math.max(LEAST, to)), grown = next / scale;
      const [left, top] = [(view.scrollLeft + x) * grown - x, (view.scrollTop + y) * grown - y];
      scale = next;
      picture.style.width = `${scale * Math.min(view.clientWidth, view.clientHeight * ratio)}px`;
      view.scrollTo(left, top);
    };
    const tools = element("div", "tl-zoom-tools", button("", "−", () => zoom(scale / STEP)), button("", "+", () => zoom(scale * STEP)),
      button("", "fit", () => zoom(1)), button("", "close", () => box.close()));
    ["Smaller", "Larger", "Fit the window", "Close"].forEach((name, i) => tools.children[i].setAttribute("aria-label", name));
    view.tabIndex = 0;
    view.setAttribute("role", "group");
    view.setAttribute("aria-label", "Figure: plus and minus change its size, arrows move it");
    box.append(tools, view, caption);

    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { left, top } = view.getBoundingClientRect();
      zoom(scale * Math.exp(-event.deltaY / 400), event.clientX - left, event.clientY - top);
    }, { passive: false });
    const fingers = new Map();
    const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    view.addEventListener("pointerdown", (event) => {
      view.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    view.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const before = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (before) zoom(scale * spread() / before);
      else view.scrollBy(last.x - event.clientX, last.y - event.clientY);
    });
    for (const end of ["pointerup", "pointercancel"]) view.addEventListener(end, (event) => fingers.delete(event.pointerId));
    box.addEventListener("keydown", (event) => {
      const act = { "+": () => zoom(scale * STEP), "=": () => zoom(scale * STEP), "-": () => zoom(scale / STEP), 0: () => zoom(1) }[event.key];
      if (act) { act(); event.preventDefault(); }
    });
    addEventListener("resize", () => box.open && zoom(scale));

    return (image) => {
      Object.assign(picture, { src: image.currentSrc || image.src, alt: image.alt, draggable: false });
      caption.textContent = image.closest("figure")?.querySelector(".caption-text")?.textContent ?? "";
      ratio = (image.naturalWidth || 1) / (image.naturalHeight || 1);
      box.showModal();
      scale = 1;
      zoom(1);
      view.focus();
    };
  };
  const show = (image) => (open ??= make())(image);

  for (const image of document.querySelectorAll(".bd-article :is(figure, .cell_output) img")) {
    const link = image.closest("a"), number = image.closest("figure")?.querySelector(".caption-text")?.textContent.split(/ of the thesis|\. /)[0];
    image.classList.add("tl-grows");
    (link ?? image).addEventListener("click", (event) => { event.preventDefault(); show(image); });
    const grow = button("tl-grow", "⤢", () => show(image));
    grow.setAttribute("aria-label", `Enlarge: ${number ?? image.alt.split(":")[0].slice(0, 60)}`);
    const frame = element("span", "tl-frame");
    (link ?? image).before(frame);
    frame.append(link ?? image, grow);
  }

  // Once nothing else is to be done the rest of the figures is loaded, so that a page that is saved has them.
  const rest = [...document.querySelectorAll(".bd-article img[loading=lazy]")];
  const idle = window.requestIdleCallback ?? ((act) => setTimeout(act, 200));
  const load = () => {
    const image = rest.shift();
    if (!image) return;
    image.loading = "eager";
    image.decode().catch(() => null).then(() => idle(load));
  };
  addEventListener("load", () => idle(load));

  // On a phone the panels of a figure stand one below the other, each as wide as the page.
  const apart = (image) => {
    const [width, height] = [image.getAttribute("width"), image.getAttribute("height")];
    const parts = image.dataset.panels.split(";").map((box) => {
      const [x, y, w, h] = box.split(" ").map(Number), copy = element("img", ""), part = element("span", "tl-panel", copy);
      Object.assign(copy, { src: image.src, alt: "", loading: "lazy" });
      Object.assign(part.style, { width: `min(100%, ${1.2 * w * width / 100}px)`, aspectRatio: `${w * width} / ${h * height}` });
      Object.assign(copy.style, { width: `${10000 / w}%`, left: `${-100 * x / w}%`, top: `${-100 * y / h}%` });
      part.addEventListener("click", () => show(image));
      return part;
    });
    image.closest(".tl-frame").append(element("span", "tl-panels", ...parts));
  };
  const phone = matchMedia("screen and (max-width: 600px)");
  const divide = () => {
    if (!phone.matches) return;
    for (const image of document.querySelectorAll(".tl-frame:not(:has(.tl-panels)) img[data-panels][width]")) apart(image);
  };
  phone.addEventListener("change", divide);
  divide();
})();
