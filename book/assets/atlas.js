// Figures of one case stand one behind the other, with a switch of the mode. Without this script, and in print, all of them are seen.
document.addEventListener("DOMContentLoaded", () => {
  const cases = new Map();
  for (const line of document.querySelectorAll(".tl-under-figure[data-case]")) {
    const { case: name, mode } = line.dataset, cell = line.previousElementSibling, figure = cell?.querySelector("figure");
    if (!figure) continue;
    if (!cases.has(name)) cases.set(name, []);
    cases.get(name).push({ mode, figure, parts: [cell.querySelector(".cell_output"), line] });
  }
  const plates = [...cases].filter(([, shown]) => shown.length > 1).map(([name, shown], n) => {
    const box = document.createElement("fieldset"), legend = document.createElement("legend");
    box.className = "tl-atlas";
    legend.textContent = `Case ${name.replaceAll("'", "′")}, mode`;
    box.append(legend);
    for (const one of shown) {
      const label = document.createElement("label");
      one.input = Object.assign(document.createElement("input"), { type: "radio", name: `tl-atlas-${n}` });
      one.input.addEventListener("change", () => choose(one));
      label.append(one.input, one.mode);
      box.append(label);
    }
    function choose(chosen) {
      for (const one of shown) {
        one.input.checked = one === chosen;
        for (const part of one.parts) part.classList.toggle("tl-behind", one !== chosen);
      }
    }
    shown[0].figure.closest(".cell_output").before(box);
    choose(shown[0]);
    return { shown, choose };
  });
  function follow() { // a link to a figure leads to its mode
    let id = location.hash.slice(1);
    try { id = decodeURIComponent(id); } catch { return; }
    for (const { shown, choose } of plates) {
      const one = id && shown.find(({ figure }) => figure.id === id);
      if (!one) continue;
      choose(one);
      one.figure.scrollIntoView();
    }
  }
  addEventListener("hashchange", follow);
  document.addEventListener("click", (event) => { // of the same address again, too
    const link = event.target.closest?.('a[href*="#"]');
    if (link && link.href === location.href) follow();
  });
  follow();
});
