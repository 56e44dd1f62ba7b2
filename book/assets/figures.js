// A click, a tap or the button next to a figure opens it as large as the window.
(() => {
  const { element, button, dialog } = window.thesisBook;
  const MAX_ZOOM = 12, ZOOM_STEP = 1.4;
  const phone = matchMedia("screen and (max-width: 600px)");
  let content = null, scale = 1, fit = () => 1; // px at which the content fits the window

  const box = dialog("tl-zoom", "Figure"), caption = element("p", "tl-zoom-caption");
  const view = element("div", { className: "tl-zoom-view", tabIndex: 0, role: "group",
    ariaLabel: "Figure: plus and minus change its size, arrows move it" });
  const tools = [["−", "Smaller", () => zoom(scale / ZOOM_STEP)], ["+", "Larger", () => zoom(scale * ZOOM_STEP)],
    ["fit", "Fit the window", () => zoom(1)], ["close", "Close", () => box.close()]];
  const buttons = tools.map(([words, ariaLabel, act]) => button("", words, act, { ariaLabel }));
  box.append(element("div", "tl-zoom-tools", ...buttons), view, caption);
  box.addEventListener("keydown", (event) => {
    const to = { "+": scale * ZOOM_STEP, "=": scale * ZOOM_STEP, "-": scale / ZOOM_STEP, 0: 1 }[event.key];
    if (!to) return;
    zoom(to);
    event.preventDefault();
  });
  addEventListener("resize", () => box.open && zoom(scale));

  // Sizes, not transforms: drawings are rendered again at each size, and so stay sharp.
  function zoom(to) { // the centre stays in place
    const [x, y] = [view.clientWidth / 2, view.clientHeight / 2];
    const next = Math.min(MAX_ZOOM, Math.max(1, to)), grown = next / scale;
    const [left, top] = [(view.scrollLeft + x) * grown - x, (view.scrollTop + y) * grown - y];
    scale = next;
    content.style.width = `${scale * fit()}px`;
    view.scrollTo(left, top);
  }
  // On a phone the panels stay stacked, each twice as wide as in the page.
  function show(image) {
    const panels = phone.matches && image.closest(".tl-frame").querySelector(".tl-panels");
    const widths = (panels ? [...panels.children] : [image]).map((one) => one.clientWidth);
    const widest = Math.max(...widths), ratio = image.naturalWidth / image.naturalHeight || 1;
    content = (panels || image).cloneNode(true);
    Object.assign(content, panels ? { role: "img", ariaLabel: image.alt }
      : { className: "", draggable: false });
    if (panels) [...content.children].forEach((panel, i) => {
      panel.style.width = `${100 * widths[i] / widest}%`;
    });
    fit = () => Math.min(view.clientWidth, panels ? Infinity : view.clientHeight * ratio);
    caption.textContent = image.closest("figure")?.querySelector(".caption-text")?.textContent ?? "";
    view.replaceChildren(content);
    box.showModal();
    zoom(phone.matches ? 2 * widest / fit() : 1);
    view.scrollTo(0, 0);
    view.focus();
  }

  for (const image of document.querySelectorAll(".bd-article :is(figure, .cell_output) img")) {
    const shown = image.closest("a") ?? image, words = image.closest("figure")
      ?.querySelector(".caption-text")?.textContent.split(/ of the thesis|\. | \(/)[0];
    image.classList.add("tl-grows");
    shown.addEventListener("click", (event) => { event.preventDefault(); show(image); });
    const ariaLabel = `Enlarge: ${words ?? image.alt.split(/[:(]/)[0].slice(0, 60).trim()}`;
    const frame = element("span", "tl-frame");
    shown.before(frame);
    frame.append(shown, button("tl-grow", "⤢", () => show(image), { ariaLabel }));
  }

  // The other figures are loaded after the page, so that a saved page has them.
  addEventListener("load", () => setTimeout(() => {
    for (const image of document.querySelectorAll(".bd-article img[loading=lazy]"))
      image.loading = "eager";
  }, 200));

  // On a phone the panels of a figure are stacked, each as wide as the page.
  const stack = (image) => {
    const [width, height] = [image.getAttribute("width"), image.getAttribute("height")];
    const panels = image.dataset.panels.split(";").map((box) => {
      const [x, y, w, h] = box.split(" ").map(Number);
      const copy = element("img", { src: image.src, alt: "", loading: "lazy", draggable: false });
      const panel = element("span", "tl-panel", copy);
      Object.assign(panel.style, { width: `min(100%, ${1.2 * w * width / 100}px)`,
        aspectRatio: `${w * width} / ${h * height}` });
      Object.assign(copy.style, { width: `${10000 / w}%`, left: `${-100 * x / w}%`,
        top: `${-100 * y / h}%` });
      return panel;
    });
    const all = { className: "tl-panels", onclick: () => show(image) };
    image.closest(".tl-frame").append(element("span", all, ...panels));
  };
  const whole = ".tl-frame:not(:has(.tl-panels)) img[data-panels][width]";
  const divide = () => {
    if (phone.matches) document.querySelectorAll(whole).forEach(stack);
  };
  phone.addEventListener("change", divide);
  divide();
})();

// Figures of one case, with a switch of the mode. Without this script, and in print, all are shown.
// A link to a hidden figure, and a search in the page, selects its mode.
(() => {
  const { element } = window.thesisBook;
  const figures = [...document.querySelectorAll(".tl-under-figure[data-case]")].map((line) => {
    const [figure, output] = ["figure", ".cell_output"]
      .map((part) => line.previousElementSibling?.querySelector(part));
    return { ...line.dataset, figure, parts: [output, line] };
  }).filter(({ figure }) => figure);
  const cases = Map.groupBy(figures, (one) => one.case);
  [...cases].filter(([, shown]) => shown.length > 1).forEach(([label, shown], n) => {
    const choose = (chosen) => shown.forEach((one) => {
      one.input.checked = one === chosen;
      for (const part of one.parts) part.hidden = one === chosen ? false : "until-found";
    });
    const labels = shown.map((one) => {
      const radio = { type: "radio", name: `tl-atlas-${n}`, onchange: () => choose(one) };
      for (const part of one.parts) part.addEventListener("beforematch", () => choose(one));
      one.input = element("input", radio);
      return element("label", "", one.input, one.mode);
    });
    const words = element("legend", "", `Case ${label.replaceAll("'", "′")}, mode`);
    const fieldset = element("fieldset", "tl-atlas", words, ...labels);
    shown[0].figure.closest(".cell_output").before(fieldset);
    const find = () => shown.find(({ figure: { id } }) => `#${id}` === location.hash);
    choose(find() ?? shown[0]);
    addEventListener("hashchange", () => { // for browsers that do not reveal hidden elements
      const one = find();
      if (!one?.parts[0].hidden) return;
      choose(one);
      one.figure.scrollIntoView();
    });
  });
})();
