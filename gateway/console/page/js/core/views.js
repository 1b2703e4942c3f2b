// Which view is shown: it is part of the address after #/, so Back works and a view can be bookmarked.
// On a wide screen several panes are side by side; then views without a pane of their own lead to the sky.

const VIEWS = ["sky", "control", "readings", "talk", "more"];
const listeners = [];

export const view = () => document.body.dataset.view;

/** Subscribe to changes of the view. */
export const onView = (listener) => listeners.push(listener);

export function show(name) {
  if (view() !== name) location.hash = `/${name}`;
}

function follow() {
  const wanted = location.hash.slice(2);
  const name = VIEWS.includes(wanted) ? wanted : "sky";
  document.body.dataset.view = name;
  for (const link of document.querySelectorAll("nav.views a")) {
    if (link.dataset.to === name) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  listeners.forEach((listener) => listener(name));
}

export function start() {
  addEventListener("hashchange", follow);
  follow();
}
