// Links tell what they lead to: pointed at, focused, or at a first tap.
(() => {
  const { root, element, entries } = window.thesisBook;
  const LINKS = ".bd-article a.reference.internal", WAIT = 250, LONGEST = 320;
  let places = null, box = null, of = null, timer = 0, touched = false;

  const known = () => (places ??= entries().then((all) => {
    const found = new Map();
    for (const entry of all) {
      if (!found.has(entry.page)) found.set(entry.page, entry);
      for (const place of entry.places) if (!found.has(`${entry.page}#${place}`)) found.set(`${entry.page}#${place}`, entry);
    }
    return found;
  }));
  const inner = (link) => link.href.startsWith(root) && !link.querySelector("img") && !link.closest(".tl-fragment, .toctree-wrapper");
  const hide = () => {
    clearTimeout(timer);
    of?.removeAttribute("aria-describedby");
    of = null;
    if (box) box.hidden = true;
  };
  const make = () => {
    const made = element("div", "tl-preview");
    Object.assign(made, { id: "tl-preview", hidden: true });
    made.setAttribute("role", "tooltip");
    made.addEventListener("pointerenter", () => clearTimeout(timer));
    made.addEventListener("pointerleave", later);
    document.body.append(made);
    return made;
  };
  const later = () => { clearTimeout(timer); timer = setTimeout(hide, WAIT); };

  const shorten = (text) => {
    if (text.length <= LONGEST) return text;
    const cut = text.slice(0, LONGEST);
    const math = cut.lastIndexOf("\\("); // an equation is not cut
    return `${math > cut.lastIndexOf("\\)") ? cut.slice(0, math) : cut.slice(0, cut.lastIndexOf(" "))} …`;
  };
  const show = async (link) => {
    const entry = (await known().catch(() => null))?.get(decodeURI(link.href.slice(root.length)));
    if (!entry || (entry.text === "" && !entry.picture) || !link.isConnected || of !== link) return;
    box ??= make();
    const text = element("p", "tl-preview-text", entry.kind === "equation" ? entry.text : shorten(entry.text));
    box.replaceChildren(element("p", "tl-preview-title", entry.title));
    if (entry.picture) box.append(Object.assign(document.createElement("img"), { src: new URL(entry.picture, root + entry.page).href, alt: "" }));
    box.append(text);
    box.hidden = false;
    link.setAttribute("aria-describedby", box.id);
    window.MathJax?.typesetPromise?.([text]).catch(() => null);
    const at = link.getClientRects()[0], width = box.offsetWidth, height = box.offsetHeight;
    const below = at.bottom + 6 + height < innerHeight || at.top < height;
    box.style.left = `${scrollX + Math.max(8, Math.min(at.left, innerWidth - width - 16))}px`;
    box.style.top = `${scrollY + (below ? at.bottom + 6 : at.top - height - 6)}px`;
  };
  const soon = (link) => {
    if (link === of) return clearTimeout(timer);
    hide();
    of = link;
    timer = setTimeout(() => show(link), WAIT);
  };
  const linked = (event) => {
    const link = event.target.closest?.(LINKS);
    return link && inner(link) ? link : null;
  };

  document.addEventListener("pointerover", (event) => {
    const link = linked(event);
    if (event.pointerType !== "touch" && link) soon(link);
  });
  document.addEventListener("pointerout", (event) => event.pointerType !== "touch" && linked(event) && later());
  document.addEventListener("focusin", (event) => { const link = linked(event); if (link && !touched) soon(link); });
  document.addEventListener("focusout", (event) => linked(event) && later());
  document.addEventListener("keydown", (event) => event.key === "Escape" && hide());
  document.addEventListener("pointerdown", (event) => { touched = event.pointerType === "touch"; if (!event.target.closest?.(`.tl-preview, ${LINKS}`)) hide(); });
  document.addEventListener("click", async (event) => { // a first tap shows, a second goes
    const link = linked(event);
    if (!link || !touched || (of === link && box && !box.hidden)) return;
    event.preventDefault();
    hide();
    of = link;
    await show(link);
    if (!box || box.hidden) location.href = link.href;
  });
})();
