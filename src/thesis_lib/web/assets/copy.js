// Buttons that copy: a command, the address of what is shown.
import { html } from "./parts.js";

// `place` holds the text, or is where it is shown and selected if there is no clipboard, or no permission.
export function copyButton(words, label, textOf, place) {
  const node = html("button", { type: "button", class: "tl-copy", "aria-label": label, "aria-live": "polite" }, words);
  node.addEventListener("click", async () => {
    const text = textOf();
    try {
      await navigator.clipboard.writeText(text);
      node.textContent = "Copied";
    } catch {
      place.textContent = text;
      getSelection().selectAllChildren(place);
      node.textContent = "Selected: now copy it";
    }
    setTimeout(() => { node.textContent = words; }, 2500);
  });
  return node;
}

export function linkButton(settle = () => {}) { // to what is shown now
  const place = html("span", { class: "tl-link" });
  const node = copyButton("Copy link", null, () => { settle(); return location.href; }, place);
  return [node, place];
}
