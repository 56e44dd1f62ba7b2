// Tables that fit, previews of links, citations; and functions shared with search.js and figures.js.
window.thesisBook = (() => {
  const root = new URL(document.documentElement.dataset.content_root ?? "./", location.href).href;
  const loading = {};
  const load = (file) => (loading[file] ??= new Promise((onload, onerror) => {
    const script = document.createElement("script");
    document.head.append(Object.assign(script, { src: root + file, onload, onerror }));
  }));
  const element = (tag, properties, ...children) => {
    const given = typeof properties === "string" ? { className: properties } : properties;
    const made = Object.assign(document.createElement(tag), given);
    made.append(...children);
    return made;
  };
  const button = (className, words, onclick, names = {}) =>
    element("button", { className, type: "button", onclick, ...names }, words);
  const closes = (dialog) => dialog.addEventListener("keydown", (event) => { // the page uses Escape, too
    if (event.key === "Escape") event.stopPropagation();
  });
  const dialog = (className, name) => { // Escape or a click outside closes it
    const made = element("dialog", { className, ariaLabel: name,
      onclick: (event) => event.target === made && made.close() });
    closes(made);
    document.body.append(made);
    return made;
  };
  const entries = async () => {
    await load("_static/entries.js");
    return window.thesisEntries.map(([page, kind, places, title, text, picture]) =>
      ({ page, kind, places, title, text, picture }));
  };
  return { root, load, element, button, dialog, closes, entries };
})();

// Tables that are too wide become tighter, on a phone one card per row; else they scroll.
addEventListener("load", async () => {
  const { element } = window.thesisBook;
  await window.MathJax?.startup?.promise;
  const phone = matchMedia("(max-width: 600px)"), MAX_CARD_ROWS = 6; // rows that become cards: more would make the page too long
  const ROLES = { THEAD: "rowgroup", TBODY: "rowgroup", TR: "row", TH: "columnheader", TD: "cell" };
  const SPANS = "[colspan]:not([colspan='1']), [rowspan]:not([rowspan='1'])";

  // A card shows its column headers; explicit roles keep it a table, which the style would undo.
  const name = (table) => {
    if (table.role) return;
    table.role = "table";
    const heads = [...table.tHead.rows[0].cells];
    for (const part of table.querySelectorAll("thead, tbody, tr, th, td"))
      part.role = part.matches("tbody th") ? "rowheader" : ROLES[part.tagName];
    for (const cell of table.querySelectorAll("tbody > tr > *")) {
      const head = heads[cell.cellIndex].cloneNode(true);
      if (!cell.textContent.trim()) cell.classList.add("tl-empty");
      if (head.textContent.trim())
        cell.prepend(element("span", { className: "tl-label", ariaHidden: true }, ...head.childNodes));
    }
  };
  const isRegular = ({ tHead, rows }) => tHead?.rows.length === 1 && rows.length <= MAX_CARD_ROWS;
  const isWide = (box) => box.scrollWidth > box.clientWidth + 1;
  const fit = (box) => { // a box around a table or an equation
    const table = box.querySelector("table"), scrolled = box.classList.contains("tl-scrolls");
    table?.classList.remove("tl-tight", "tl-cards");
    box.classList.remove("tl-scrolls");
    if (table && isWide(box)) {
      if (!phone.matches) table.classList.add("tl-tight");
      else if (isRegular(table) && !table.querySelector(SPANS)) {
        name(table);
        table.classList.add("tl-cards");
      }
    }
    if (box.classList.toggle("tl-scrolls", isWide(box))) box.tabIndex = 0;
    else if (scrolled) box.removeAttribute("tabindex");
  };
  const widths = new Map();
  const watch = new ResizeObserver((seen) => {
    for (const { target, contentRect: { width } } of seen) {
      if (!width || widths.get(target) === width) continue;
      widths.set(target, width);
      requestAnimationFrame(() => fit(target)); // at once, the observer would report a loop
    }
  });
  for (const one of document.querySelectorAll(".bd-article div.math mjx-container, .bd-article table"))
    if (!one.closest(".tl-fragment")) watch.observe(one.matches("table") ? one.parentElement : one);
});

// Previews of links: on hover, on focus, or at a first tap.
(() => {
  const { root, element, entries } = window.thesisBook;
  const LINKS = ".bd-article a.reference.internal", WAIT_MS = 250, MAX_TEXT_LENGTH = 320; // ms, characters
  let places = null, of = null, timer = 0, touched = false;

  const known = () => (places ??= entries().then((all) => new Map( // the first of two at one place
    all.toReversed().flatMap((entry) => [...entry.places.map((place) => `#${place}`), ""]
      .map((place) => [entry.page + place, entry])))));
  const hide = () => {
    clearTimeout(timer);
    of?.removeAttribute("aria-describedby");
    of = null;
    box.hidden = true;
  };
  const later = () => { clearTimeout(timer); timer = setTimeout(hide, WAIT_MS); };
  const box = element("div", { className: "tl-preview", id: "tl-preview", role: "tooltip",
    hidden: true, onpointerenter: () => clearTimeout(timer), onpointerleave: later });
  document.body.append(box);
  const shorten = (text) => {
    if (text.length <= MAX_TEXT_LENGTH) return text;
    const cut = text.slice(0, MAX_TEXT_LENGTH), math = cut.lastIndexOf("\\("); // equations are not cut
    return `${cut.slice(0, math > cut.lastIndexOf("\\)") ? math : cut.lastIndexOf(" "))} …`;
  };
  const show = async (link) => {
    const entry = (await known().catch(() => null))?.get(decodeURI(link.href.slice(root.length)));
    if (!(entry?.text || entry?.picture) || !link.isConnected || of !== link) return;
    const { kind, title, picture, page } = entry;
    const text = element("p", "", kind === "equation" ? entry.text : shorten(entry.text));
    box.replaceChildren(element("p", "tl-preview-title", title));
    if (picture) box.append(element("img", { src: new URL(picture, root + page).href, alt: "" }));
    box.append(text);
    box.hidden = false;
    link.setAttribute("aria-describedby", box.id);
    window.MathJax?.typesetPromise?.([text]).catch(() => null);
    const at = link.getClientRects()[0], width = box.offsetWidth, height = box.offsetHeight;
    const below = at.bottom + 6 + height < innerHeight || at.top < height;
    const left = Math.max(8, Math.min(at.left, innerWidth - width - 16));
    const top = below ? at.bottom + 6 : at.top - height - 6;
    Object.assign(box.style, { left: `${scrollX + left}px`, top: `${scrollY + top}px` });
  };
  const soon = (link) => {
    if (link === of) return clearTimeout(timer);
    hide();
    of = link;
    timer = setTimeout(() => show(link), WAIT_MS);
  };
  const on = (type, act, wanted = () => true) => document.addEventListener(type, (event) => {
    const link = event.target.closest?.(LINKS), isInner = link?.href.startsWith(root) &&
      !link.querySelector("img") && !link.closest(".tl-fragment, .toctree-wrapper");
    if (isInner && wanted(event)) act(link, event);
  });
  const byMouse = (event) => event.pointerType !== "touch";

  on("pointerover", soon, byMouse);
  on("pointerout", later, byMouse);
  on("focusin", soon, () => !touched);
  on("focusout", later);
  on("click", async (link, event) => { // a first tap shows the preview, a second follows the link
    event.preventDefault();
    hide();
    of = link;
    await show(link);
    if (box.hidden) location.href = link.href;
  }, ({ target }) => touched && (box.hidden || of !== target.closest(LINKS)));
  document.addEventListener("keydown", (event) => event.key === "Escape" && hide());
  document.addEventListener("pointerdown", (event) => {
    touched = event.pointerType === "touch";
    if (!event.target.closest?.(`.tl-preview, ${LINKS}`)) hide();
  });
})();

// Citations of this page, a figure or its data, with the edition of the book.
(() => {
  const { root, load, element, button, dialog } = window.thesisBook;
  const tools = document.querySelector(".article-header-buttons");
  if (!tools || !document.querySelector(".bd-article h1")) return;

  const list = (edition) => { // citable items: a name, an anchor, a key
    const page = location.href.slice(root.length).split(/[?#]/)[0];
    const [title] = document.title.split(" — "), keyOf = (text) => text.replace(/\W+/g, "-");
    const made = [{ name: title, at: page, key: keyOf(page.replace(/\.html$/, "")) }];
    for (const figure of document.querySelectorAll(".bd-article figure[id]")) {
      const caption = figure.querySelector(".caption-text")?.textContent.trim();
      const name = caption?.split(/ of the thesis|\. |\.$/)[0].slice(0, 90);
      if (name) made.push({ name: `${name} (${title})`, at: `${page}#${figure.id}`, key: figure.id });
    }
    for (const cube of document.querySelectorAll(".tl-provenance a[href$='.nc']")) {
      const file = cube.getAttribute("href").split("/").pop();
      const facts = cube.closest(".tl-provenance").textContent;
      const [, commit = edition.commit] = facts.match(/commit (\w{7,40})/) ?? [];
      const [, hash] = facts.match(/hash (\w{6,})/) ?? [];
      const name = `Cube ${file}${hash ? `, parameters ${hash}` : ""}`;
      made.push({ name, at: `data/${file}`, key: keyOf(file), commit });
    }
    return made.map((one) => ({ ...edition, ...one }));
  };
  const tex = (text) => text.replace(/[\\{}]/g, "").replace(/[%&#_$]/g, "\\$&");
  const formsOf = ({ authors, title, version, date, name, at, key, commit }) => ({
    "Plain": `${authors}: ${title}. ${name}. Version ${version}, commit ${commit}, ${date}. ${at}`,
    "APA": `${authors}. (${date.slice(0, 4)}). ${name}. In ${title} (Version ${version}, commit ` +
      `${commit}; ${date}) [Computer software]. ${at}`,
    "BibTeX": `@misc{vibration-${key},
  author = {{${tex(authors)}}},
  title = {${tex(name)}},
  howpublished = {In: ${tex(title)}, ${tex(at)}},
  year = {${date.slice(0, 4)}},
  note = {Version ${tex(version)}, commit ${commit}, ${date}}
}`,
  });

  let box = null;
  const show = async () => {
    await load("_static/edition.js");
    const all = list(window.thesisEdition), said = element("p", { role: "status" });
    const places = element("div", "");
    const fill = () => {
      const forms = Object.entries(formsOf(all[chosen.value]));
      places.replaceChildren(...forms.flatMap(([form, text]) => {
        const place = element("pre", { tabIndex: 0 }, text);
        return [element("h2", "", form), button("", "copy", async () => {
          await navigator.clipboard.writeText(text)
            .catch(() => getSelection().selectAllChildren(place));
          said.textContent = `${form}: copied.`;
        }, { ariaLabel: `Copy ${form}` }), place];
      }));
    };
    const chosen = element("select", { onchange: fill }, ...all.map((one, i) =>
      new Option(i ? one.name : `This page: ${one.name}`, i)));
    // The figure that the URL names, if any.
    const named = all.findIndex((one) => location.hash && one.at.endsWith(location.hash));
    chosen.value = Math.max(0, named);
    fill();
    box ??= dialog("tl-cites", "Cite");
    box.replaceChildren(element("label", "", "What ", chosen), places, said,
      button("", "close", () => box.close()));
    box.showModal();
  };
  const sign = element("i", { className: "fa-solid fa-quote-right", ariaHidden: "true" });
  tools.prepend(button("btn btn-sm pst-navbar-icon tl-cite", sign, show,
    { ariaLabel: "Cite this page", title: "Cite" }));
})();
