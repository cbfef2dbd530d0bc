// Elements of the page.

export const PHONE = 500; // px
export const NARROW = 760; // px; narrower pages have one column

export const find = (id) => document.getElementById(id);
export const make = (name, cls, text) => {
  const element = document.createElement(name);
  if (cls) element.className = cls;
  if (text !== undefined) element.textContent = text; // never as HTML, as names may contain anything
  return element;
};

export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function button(cls, text, title, press) {
  const element = make("button", cls, text);
  element.title = title;
  element.addEventListener("click", press);
  return element;
}
