// What the scripts of every page share.
window.thesisBook = (() => {
  const root = new URL(document.documentElement.dataset.content_root ?? "./", location.href).href;
  const loading = {};
  const load = (file) => (loading[file] ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    Object.assign(script, { src: root + file, onload: resolve, onerror: reject });
    document.head.append(script);
  }));
  const element = (tag, className, ...children) => {
    const made = Object.assign(document.createElement(tag), { className });
    made.append(...children);
    return made;
  };
  const button = (className, words, act) => {
    const made = element("button", className, words);
    made.type = "button";
    made.addEventListener("click", act);
    return made;
  };
  const closes = (dialog) => dialog.addEventListener("keydown", (event) => { // the page has another use for Escape
    if (event.key === "Escape") event.stopPropagation();
  });
  const dialog = (className, name) => { // Escape closes it, and so does a click beside it
    const made = element("dialog", className);
    made.setAttribute("aria-label", name);
    made.addEventListener("click", (event) => event.target === made && made.close());
    closes(made);
    document.body.append(made);
    return made;
  };
  const entries = async () => {
    await load("_static/entries.js");
    return window.thesisEntries.map(([page, kind, places, title, text, picture]) => ({ page, kind, places, title, text, picture }));
  };
  return { root, load, element, button, dialog, closes, entries };
})();
