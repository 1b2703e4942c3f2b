/**
 * Draws Sun, Moon and planets; the Moon with its phase. Their names never overlap: where two bodies are close together
 * the later one has none.
 */
import { lit, towards } from "../moon.js";

const RADIUS = { Sun: 8, Moon: 8 }, PLANET = 3.6;
/** Planets too faint for the eye are shown only on an enlarged chart. */
const FAINT = ["Uranus", "Neptune", "Pluto"];

function radius(name) {
  return RADIUS[name] ?? PLANET;
}

/** The bodies that are above the horizon and on this chart. */
export function shown({ scene, view }) {
  return scene.bodies.filter(({ name, at }) => at[2] > -0.01 && (view.scale > 500 || !FAINT.includes(name)));
}

/** Draw them, and keep them free of text. */
export function bodies(brush) {
  const { context, view, scene, colours, labels } = brush;
  const sun = scene.bodies.find(({ name }) => name === "Sun");
  for (const { name, at } of shown(brush)) {
    const [x, y] = view.point(at), r = radius(name);
    if (!view.sees(x, y, 20)) continue;
    if (name === "Moon" && sun) moon(context, colours, x, y, r, lit(at, sun.at), towards(view, at, sun.at));
    else disk(context, x, y, r, name === "Sun" ? colours.sun : colours.planet);
    if (name === "Sun") rays(context, x, y, r, colours.sun);
    labels.keepFree(x, y, r);
  }
}

export function bodyNames(brush) {
  const { view, colours, labels, chosen } = brush;
  for (const { name, at } of shown(brush)) {
    const [x, y] = view.point(at);
    if (!view.sees(x, y, 20) || name === chosen?.name) continue; // the mark of what is chosen has its name already
    labels.beside(x, y, name, {
      size: 12, weight: 600, gap: radius(name) + (name === "Sun" ? 9 : 5),
      colour: colours[name === "Sun" ? "sun" : name === "Moon" ? "moon" : "planet"],
    });
  }
}

export function disk(context, x, y, r, colour) {
  context.fillStyle = colour;
  context.beginPath();
  context.arc(x, y, r, 0, 2 * Math.PI);
  context.fill();
}

function rays(context, x, y, r, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.beginPath();
  for (let ray = 0; ray < 12; ray += 1) {
    const angle = (ray / 12) * 2 * Math.PI, right = Math.cos(angle), down = Math.sin(angle);
    context.moveTo(x + right * (r + 2.5), y + down * (r + 2.5));
    context.lineTo(x + right * (r + 5), y + down * (r + 5));
  }
  context.stroke();
}

/** The lit part: a half circle towards the Sun, plus or minus half an ellipse. */
function moon(context, colours, x, y, r, part, angle) {
  disk(context, x, y, r, colours["moon-dark"]);
  context.save();
  context.translate(x, y);
  context.rotate(angle);
  context.fillStyle = colours.moon;
  context.beginPath();
  context.arc(0, 0, r, -Math.PI / 2, Math.PI / 2);
  context.ellipse(0, 0, r * Math.abs(1 - 2 * part), r, 0, Math.PI / 2, -Math.PI / 2, part < 0.5);
  context.fill();
  context.restore();
}
