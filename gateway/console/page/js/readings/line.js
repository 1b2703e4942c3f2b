// The line to the mount: a plot of its answer times and failed exchanges.

import { HEADINGS } from "../core/labels.js";
import { el, group, say } from "../core/dom.js";
import { onLight } from "../frame/night.js";
import { on } from "../core/socket.js";
import { gatewayNow, mount, state, subscribe } from "../core/store.js";

/** The time span of the plot, seconds. */
const WINDOW = 60;
/** Per mount the answer times of the window: [Unix seconds, milliseconds or null for a fault]. @type {Array<Array<[number, number|null]>>} */
const samples = [];
const canvas = el("canvas", { class: "plot", role: "img" });
const figures = el("p", { class: "figures-line" });

function keep(times) {
  times.forEach((added, index) => {
    // Every message has values again that the page already has.
    const known = samples[index] ?? [], last = known.at(-1)?.[0] ?? 0, since = gatewayNow() - WINDOW - 5;
    samples[index] = [...known, ...added.filter(([at]) => at > last)].filter(([at]) => at > since);
  });
}

/** The highest value of the axis: 1, 2 or 5 times a power of ten. */
function nice(highest) {
  const power = 10 ** Math.floor(Math.log10(Math.max(highest, 1)));
  return [1, 2, 5, 10].map((part) => part * power).find((value) => value >= highest);
}

function draw() {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || document.hidden) return;
  const scale = devicePixelRatio || 1;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const paint = canvas.getContext("2d");
  paint.scale(scale, scale);
  const style = getComputedStyle(canvas);
  const now = gatewayNow();
  const shown = (samples[state.chosen] ?? []).filter(([at]) => at > now - WINDOW);
  const top = nice(Math.max(5, ...shown.map(([, ms]) => ms ?? 0)));
  const x = (at) => width - ((now - at) / WINDOW) * width;
  const y = (ms) => height - 3 - (ms / top) * (height - 18);
  paint.strokeStyle = style.borderTopColor;
  paint.fillStyle = style.color;
  paint.font = `11px ${style.fontFamily}`;
  for (const part of [0, 0.5, 1]) {
    paint.beginPath();
    paint.moveTo(0, y(top * part));
    paint.lineTo(width, y(top * part));
    paint.stroke();
  }
  paint.fillText(`${top} ms`, 2, y(top) - 4);
  // An answer is a stem from below, a fault a cross at the top, so that they differ without colour.
  paint.strokeStyle = paint.fillStyle = style.outlineColor;
  for (const [at, ms] of shown) {
    paint.beginPath();
    if (ms === null) {
      paint.moveTo(x(at) - 3, 3); paint.lineTo(x(at) + 3, 9); paint.moveTo(x(at) + 3, 3); paint.lineTo(x(at) - 3, 9);
    } else {
      paint.moveTo(x(at), y(0)); paint.lineTo(x(at), Math.min(y(ms), y(0) - 1.5));
    }
    paint.stroke();
  }
}

const many = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

export function lineGroup() {
  on("line", keep);
  onLight(draw);
  subscribe(() => {
    const line = mount()?.line;
    if (!line) return;
    const words = `Answers in ${Math.round(line.typical * 1000) || "under 1"} ms, ${line.rate.toFixed(1)} a second; ${many(line.faults, "fault")} since this page was opened.`;
    say(figures, words);
    canvas.setAttribute("aria-label", `Answer times of the last ${WINDOW} seconds. ${words}`);
  });
  setInterval(draw, 500);
  return group(HEADINGS.line, canvas, figures);
}
