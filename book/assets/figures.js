// Figures grow: a click, a tap or the button beside them opens them as large as the window.
(() => {
  const { element, button, dialog } = window.thesisBook;
  const MOST = 12, STEP = 1.4;
  const phone = matchMedia("screen and (max-width: 600px)");
  let open = null;

  const make = () => {
    const box = dialog("tl-zoom", "Figure"), view = element("div", "tl-zoom-view");
    const caption = element("p", "tl-zoom-caption");
    let content = null, scale = 1, fit = () => 1; // px at which the content fits the window
    // Sizes, not transforms: drawings are drawn again at each size, and so stay sharp.
    const zoom = (to, x = view.clientWidth / 2, y = view.clientHeight / 2) => {
      const next = Math.min(MOST, Math.max(1, to)), grown = next / scale;
      const [left, top] = [(view.scrollLeft + x) * grown - x, (view.scrollTop + y) * grown - y];
      scale = next;
      content.style.width = `${scale * fit()}px`;
      view.scrollTo(left, top);
    };
    const tools = [["−", "Smaller", () => zoom(scale / STEP)], ["+", "Larger", () => zoom(scale * STEP)],
      ["fit", "Fit the window", () => zoom(1)], ["close", "Close", () => box.close()]];
    const buttons = tools.map(([words, name, act]) =>
      Object.assign(button("", words, act), { ariaLabel: name }));
    Object.assign(view, { tabIndex: 0, role: "group",
      ariaLabel: "Figure: plus and minus change its size, arrows move it" });
    box.append(element("div", "tl-zoom-tools", ...buttons), view, caption);

    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { left, top } = view.getBoundingClientRect();
      zoom(scale * Math.exp(-event.deltaY / 400), event.clientX - left, event.clientY - top);
    }, { passive: false });
    const fingers = new Map();
    const spread = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
    };
    view.addEventListener("pointerdown", (event) => {
      view.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, event);
    });
    view.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last) return;
      const before = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, event);
      if (before) zoom(scale * spread() / before);
      else view.scrollBy(last.clientX - event.clientX, last.clientY - event.clientY);
    });
    for (const end of ["pointerup", "pointercancel"])
      view.addEventListener(end, (event) => fingers.delete(event.pointerId));
    box.addEventListener("keydown", (event) => {
      const to = { "+": scale * STEP, "=": scale * STEP, "-": scale / STEP, 0: 1 }[event.key];
      if (!to) return;
      zoom(to);
      event.preventDefault();
    });
    addEventListener("resize", () => box.open && zoom(scale));

    // On a phone the panels stay one below the other, each twice as wide as in the page.
    return (image) => {
      const panels = phone.matches && image.closest(".tl-frame").querySelector(".tl-panels");
      const widths = (panels ? [...panels.children] : [image]).map((one) => one.clientWidth);
      const widest = Math.max(...widths);
      content = (panels || image).cloneNode(true);
      Object.assign(content, panels ? { role: "img", ariaLabel: image.alt }
        : { className: "", draggable: false });
      if (panels) [...content.children].forEach((panel, i) => {
        panel.style.width = `${100 * widths[i] / widest}%`;
      });
      const ratio = image.naturalWidth / image.naturalHeight || 1;
      fit = () => Math.min(view.clientWidth, panels ? Infinity : view.clientHeight * ratio);
      caption.textContent = image.closest("figure")?.querySelector(".caption-text")?.textContent ?? "";
      view.replaceChildren(content);
      box.showModal();
      zoom(phone.matches ? 2 * widest / fit() : 1);
      view.scrollTo(0, 0);
      view.focus();
    };
  };
  const show = (image) => (open ??= make())(image);

  for (const image of document.querySelectorAll(".bd-article :is(figure, .cell_output) img")) {
    const shown = image.closest("a") ?? image, words = image.closest("figure")
      ?.querySelector(".caption-text")?.textContent.split(/ of the thesis|\. | \(/)[0];
    image.classList.add("tl-grows");
    shown.addEventListener("click", (event) => { event.preventDefault(); show(image); });
    const grow = button("tl-grow", "⤢", () => show(image));
    grow.ariaLabel = `Enlarge: ${words ?? image.alt.split(/[:(]/)[0].slice(0, 60).trim()}`;
    const frame = element("span", "tl-frame");
    shown.before(frame);
    frame.append(shown, grow);
  }

  // The rest of the figures is loaded once nothing else is to be done: a saved page has them.
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
  const stack = (image) => {
    const [width, height] = [image.getAttribute("width"), image.getAttribute("height")];
    const panels = image.dataset.panels.split(";").map((box) => {
      const [x, y, w, h] = box.split(" ").map(Number);
      const copy = element("img", ""), panel = element("span", "tl-panel", copy);
      Object.assign(copy, { src: image.src, alt: "", loading: "lazy", draggable: false });
      Object.assign(panel.style, { width: `min(100%, ${1.2 * w * width / 100}px)`,
        aspectRatio: `${w * width} / ${h * height}` });
      Object.assign(copy.style, { width: `${10000 / w}%`, left: `${-100 * x / w}%`,
        top: `${-100 * y / h}%` });
      return panel;
    });
    const all = element("span", "tl-panels", ...panels);
    all.addEventListener("click", () => show(image));
    image.closest(".tl-frame").append(all);
  };
  const whole = ".tl-frame:not(:has(.tl-panels)) img[data-panels][width]";
  const divide = () => {
    if (phone.matches) document.querySelectorAll(whole).forEach(stack);
  };
  phone.addEventListener("change", divide);
  divide();
})();
