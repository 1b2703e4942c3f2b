// Which view is shown: the address says it after #/, so Back works and a view can be bookmarked.
// On a wide screen several panes stand side by side; then the views that have no pane of their own lead to the sky.

const VIEWS = ["sky", "control", "readings", "talk", "more"];
const listeners = [];

export const view = () => document.body.dataset.view;

/** Be told when another view is shown. */
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
