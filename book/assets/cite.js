// How to cite this page, a figure or the data on it, with the edition that was read.
(() => {
  const { root, load, element, button, dialog } = window.thesisBook;
  const tools = document.querySelector(".article-header-buttons"), heading = document.querySelector(".bd-article h1");
  if (!tools || !heading) return;

  // What can be cited here: a name, an anchor, a key.
  const things = () => {
    const page = location.href.slice(root.length).split(/[?#]/)[0], title = document.title.split(" — ")[0];
    const made = [{ name: title, at: page, key: page.replace(/\.html$/, "").replace(/\W+/g, "-") }];
    for (const figure of document.querySelectorAll(".bd-article figure[id]")) {
      const [name] = figure.querySelector(".caption-text")?.textContent.trim().split(/ of the thesis|\. |\.$/) ?? [];
      if (name) made.push({ name: `${name.slice(0, 90)} (${title})`, at: `${page}#${figure.id}`, key: figure.id });
    }
    for (const cube of document.querySelectorAll(".tl-provenance a[href$='.nc']")) {
      const file = cube.getAttribute("href").split("/").pop(), facts = cube.closest(".tl-provenance").textContent;
      const commit = facts.match(/commit (\w{7,40})/)?.[1], hash = facts.match(/hash (\w{6,})/)?.[1];
      made.push({ name: `Cube ${file}${hash ? `, parameters ${hash}` : ""}`, at: `data/${file}`, key: file.replace(/\W+/g, "-"), commit });
    }
    return made;
  };
  const plain = (one, book) => `${book.authors}: ${book.title}. ${one.name}. Version ${book.version}, commit ${one.commit ?? book.commit}, ${book.date}. ${one.at}`;
  const apa = (one, book) => `${book.authors}. (${book.date.slice(0, 4)}). ${one.name}. In ${book.title} (Version ${book.version}, commit ${one.commit ?? book.commit}; ${book.date}) [Computer software]. ${one.at}`;
  const tex = (text) => text.replace(/[\\{}]/g, "").replace(/[%&#_$]/g, "\\$&");
  const bibtex = (one, book) => `@misc{vibration-${one.key},
  author = {{${tex(book.authors)}}},
  title = {${tex(one.name)}},
  howpublished = {In: ${tex(book.title)}, ${tex(one.at)}},
  year = {${book.date.slice(0, 4)}},
  note = {Version ${tex(book.version)}, commit ${one.commit ?? book.commit}, ${book.date}}
}`;
  const FORMS = { "Plain": plain, "APA": apa, "BibTeX": bibtex };

  let box = null;
  const make = () => {
    const made = dialog("tl-cites", "Cite"), all = things(), chosen = element("select", "");
    all.forEach((one, i) => chosen.append(new Option(i ? one.name : `This page: ${one.name}`, i)));
    const said = element("p", ""), shown = Object.keys(FORMS).map((form) => {
      const text = element("pre", ""), copy = button("", "copy", async () => {
        await navigator.clipboard.writeText(text.textContent).catch(() => getSelection().selectAllChildren(text));
        said.textContent = `${form}: copied.`;
      });
      text.tabIndex = 0;
      copy.setAttribute("aria-label", `Copy ${form}`);
      made.append(element("h2", "", form), copy, text);
      return text;
    });
    said.setAttribute("role", "status");
    const close = button("", "close", () => made.close()), choice = element("label", "", "What ", chosen);
    made.prepend(choice);
    made.append(said, close);
    const fill = () => Object.values(FORMS).forEach((form, i) => { shown[i].textContent = form(all[chosen.value], window.thesisEdition); });
    chosen.addEventListener("change", fill);
    return () => { // of a figure that the address names, that figure
      const named = all.findIndex((one) => location.hash && one.at.endsWith(location.hash));
      if (named > 0) chosen.value = named;
      said.textContent = "";
      fill();
      made.showModal();
    };
  };
  const open = () => load("_static/edition.js").then(() => (box ??= make())());
  const cite = button("btn btn-sm pst-navbar-icon tl-cite", "", open);
  cite.setAttribute("aria-label", "Cite this page");
  cite.title = "Cite";
  cite.append(Object.assign(element("i", "fa-solid fa-quote-right"), { ariaHidden: "true" }));
  tools.prepend(cite);
})();
