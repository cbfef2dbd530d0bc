// Elements of the page.

import { inOrder } from "./letters.js";

export const PHONE = 500; // px
export const NARROW = 760; // px; narrower pages have one column

export const find = (id) => document.getElementById(id);
export const make = (name, cls, text) => {
  const element = document.createElement(name);
  if (cls) element.className = cls;
  if (text !== undefined) element.textContent = inOrder(text); // never as HTML, as names may contain anything
  return element;
};

export function put(element, text) {
  const shown = inOrder(text);
  if (element.textContent !== shown) element.textContent = shown;
}

export function button(cls, text, title, press) {
  const element = make("button", cls, text);
  element.title = title;
  element.addEventListener("click", press);
  return element;
}
