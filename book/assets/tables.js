// Tables wider than their place become tighter, on a phone cards, a row each; what still is too wide says that it scrolls.
addEventListener("load", async () => {
  const { element } = window.thesisBook;
  await window.MathJax?.startup?.promise;
  const phone = matchMedia("(max-width: 600px)"), MOST = 6; // rows that become cards: of more a page would have no end
  const ROLES = { THEAD: "rowgroup", TBODY: "rowgroup", TR: "row", TH: "columnheader", TD: "cell" };

  // A card says the heads of its columns; the roles stay those of a table, which the style takes away.
  const name = (table) => {
    if (table.role) return;
    table.role = "table";
    const heads = [...table.tHead.rows[0].cells];
    for (const part of table.querySelectorAll("thead, tbody, tr, th, td")) part.role = part.closest("tbody") && part.tagName === "TH" ? "rowheader" : ROLES[part.tagName];
    for (const body of table.tBodies) for (const row of body.rows) [...row.cells].forEach((cell, i) => {
      if (!cell.textContent.trim()) cell.classList.add("tl-empty");
      if (!heads[i].textContent.trim()) return;
      const label = element("span", "tl-label", ...[...heads[i].childNodes].map((one) => one.cloneNode(true)));
      label.ariaHidden = true;
      cell.prepend(label);
    });
  };
  const regular = (table) => table.tHead?.rows.length === 1 && table.rows.length <= MOST && !table.querySelector("[colspan]:not([colspan='1']), [rowspan]:not([rowspan='1'])");
  const fit = (table, box) => {
    const wide = () => box.scrollWidth > box.clientWidth + 1;
    table.classList.remove("tl-tight", "tl-cards");
    box.classList.remove("tl-scrolls");
    if (wide() && !phone.matches) table.classList.add("tl-tight");
    else if (wide() && regular(table)) {
      name(table);
      table.classList.add("tl-cards");
    }
    if (wide()) {
      box.classList.add("tl-scrolls");
      box.tabIndex = 0;
    }
  };
  const widths = new Map();
  const watch = new ResizeObserver((seen) => {
    for (const { target, contentRect: { width } } of seen) {
      if (!width || widths.get(target) === width) continue;
      widths.set(target, width);
      requestAnimationFrame(() => fit(target.querySelector("table"), target)); // at once would be told as a loop
    }
  });
  // An equation that is wider than a phone says that it scrolls, too.
  const equations = new ResizeObserver((seen) => {
    for (const { target } of seen) requestAnimationFrame(() => {
      const wide = target.scrollWidth > target.clientWidth + 1;
      if (wide === target.classList.contains("tl-scrolls")) return;
      target.classList.toggle("tl-scrolls", wide);
      if (wide) target.tabIndex = 0; else target.removeAttribute("tabindex");
    });
  });
  for (const one of document.querySelectorAll(".bd-article div.math mjx-container")) equations.observe(one);
  for (const table of document.querySelectorAll(".bd-article table")) {
    if (!table.closest(".tl-fragment")) watch.observe(table.parentElement);
  }
});
