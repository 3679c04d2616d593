// Elements of a page, and its texts.

/** An element with attributes and children; attributes that begin with "on" are listeners. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "html") element.innerHTML = value;      // only of Markdown that the server has rendered
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.filter(child => child !== null));
  return element;
}

/** A text with its values filled in. */
export const filled = (text, values) => text.replace(/\{(\w+)\}/g, (whole, name) => name in values ? values[name] : whole);

/** Fills in the texts that elements name: `data-text` for all, `data-label` for screen readers. */
export function translate(t) {
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = t(element.dataset.text);
  for (const element of document.querySelectorAll("[data-label]")) element.setAttribute("aria-label", t(element.dataset.label));
}

export const byId = id => document.getElementById(id);

/** Address of the page's web socket. */
export const socketAddress = () => location.href.replace(/^http/, "ws").replace(/[?#].*$/, "").replace(/\/$/, "") + "/socket";
