/**
 * Uses the sky chart as fingers, a mouse and keys do, and posts what was seen to /done: the test judges it.
 */
import { load } from "/page/js/sky/catalogue.js";
import { Sky } from "/page/js/sky/sky.js";
import { Scene } from "/page/js/sky/scene.js";
import { View } from "/page/js/sky/view.js";

const canvas = document.querySelector("canvas"), said = [], picked = [], found = { errors: [] };
addEventListener("error", (event) => found.errors.push(String(event.message)));
addEventListener("unhandledrejection", (event) => found.errors.push(String(event.reason)));

const mount = {
  index: 0, site: { latitude: 48.1, longitude: 11.6 }, sidereal: 300, position: { alt: 52, az: 110 },
  target: { alt: 30, az: 230 }, equatorial: true, german: false,
  limits: { lowest: 12, highest: 85, sun: 20, hour_angle: 95 },
  bodies: [
    { name: "Sun", ra2000: 270, dec2000: -10 }, { name: "Moon", ra2000: 345, dec2000: -8 },
    { name: "Saturn", ra2000: 10, dec2000: 10 },
  ],
};
const frames = { count: 0, times: [] }, frame = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (act) => frame((time) => {
  const began = performance.now();
  act(time);
  frames.count += 1;
  frames.times.push(performance.now() - began);
});
const settled = () => new Promise((done) => frame(() => frame(() => setTimeout(done))));

/** Where a place of J2000 is on the unenlarged canvas, by the chart's own modules. */
const view = new View();
view.resize(390, 600);
const spot = (ra, dec) => view.point(new Scene(mount, 0, Date.now() / 1000).place(ra, dec));

let pointer = 1, now = 0;
function touch(kind, x, y, id = pointer) {
  const event = new PointerEvent(kind, { clientX: x, clientY: y, pointerId: id, pointerType: "touch", bubbles: true });
  Object.defineProperty(event, "timeStamp", { value: now });
  canvas.dispatchEvent(event);
}
function tap(x, y) {
  now += 1000;
  touch("pointerdown", x, y);
  now += 50;
  touch("pointerup", x, y);
}
function press(key, more = {}) {
  const event = new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more });
  let reached = false;
  const hear = () => (reached = true);
  addEventListener("keydown", hear, { once: true });
  canvas.dispatchEvent(event);
  removeEventListener("keydown", hear);
  return { prevented: event.defaultPrevented, reached };
}

/** All pixels: how many different ones, the most green and blue, and whether any breaks the rule of the night. */
function pixels() {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height), kinds = new Set();
  let wrong = 0, reddest = 0;
  for (let at = 0; at < data.length; at += 4) {
    const part = data[at + 3] / 255, [red, green, blue] = [0, 1, 2].map((one) => Math.round(data[at + one] * part));
    kinds.add((red << 16) | (green << 8) | blue);
    reddest = Math.max(reddest, red);
    if (Math.max(green, blue) > red / 10 || Math.max(green, blue) >= 16) wrong += 1;
  }
  return { kinds: kinds.size, wrong, reddest };
}

async function run() {
  canvas.setPointerCapture = () => {};
  const sky = new Sky(canvas, { onPick: (place) => picked.push(place), say: (text) => said.push(text) });
  await load();
  sky.update(mount);
  await settled();
  await settled();
  found.role = [canvas.getAttribute("role"), canvas.tabIndex, canvas.getAttribute("aria-label")];
  found.size = [canvas.width / devicePixelRatio, canvas.height / devicePixelRatio];
  found.day = pixels();

  tap(...spot(279.2347, 38.7837).map((value) => value + 4));
  tap(...spot(10, 10));
  tap(...spot(300, 40));
  found.picked = picked.splice(0);
  tap(3, 3);
  found.outside = picked.length;
  await settled();

  const at = spot(279.2347, 38.7837);
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -600, clientX: at[0], clientY: at[1], cancelable: true }));
  tap(...at);
  found.underTheWheel = picked.splice(0).map(({ name }) => name);
  touch("pointerdown", 200, 300);
  touch("pointermove", 240, 330);
  touch("pointerup", 240, 330);
  await settled();
  found.draggedPicks = picked.splice(0).length;
  tap(at[0] + 40, at[1] + 30);
  found.underTheDrag = picked.splice(0).map(({ name }) => name);
  now += 5000;
  tap(...at);
  now -= 900;
  tap(...at);
  picked.length = 0;
  await settled();
  tap(...at);
  found.afterDoubleTap = picked.splice(0).map(({ name }) => name);

  now += 5000;
  touch("pointerdown", 180, 300, 7);
  touch("pointerdown", 220, 300, 8);
  touch("pointermove", 260, 300, 8);
  touch("pointerup", 260, 300, 8);
  touch("pointerup", 180, 300, 7);
  await settled();
  tap(...at);
  found.pinched = picked.splice(0).map(({ name }) => name === "Vega");
  sky.reset();
  await settled();

  found.keys = [press("ArrowUp"), press("ArrowLeft", { shiftKey: true }), press("Enter"), press("+"), press("0")];
  found.left = [press(" "), press("Escape"), press("ArrowUp", { ctrlKey: true })];
  found.keyPicks = picked.splice(0).length;
  found.said = said.splice(0);
  sky.highlight({ ra2000: 300, dec2000: 40, name: "somewhere" });

  document.documentElement.dataset.night = "";
  sky.setNight(true);
  await settled();
  found.night = pixels();
  sky.setUp("zenith");
  sky.enlarge(3);
  await settled();
  found.nightEnlarged = pixels();
  sky.highlight(null);
  sky.reset();
  await settled();

  frames.times.length = 0;
  for (let step = 0; step < 60; step += 1) {
    sky.update({ ...mount, position: { alt: 52, az: 110 + step } });
    await settled();
  }
  found.quick = frames.times.sort((a, b) => a - b)[Math.floor(frames.times.length / 10)];
  const rests = { ...mount, position: { alt: 52, az: 169.02 } };
  sky.update({ ...rests, sidereal: 300.001 });  // on a busy computer the sky has turned meanwhile
  await settled();
  frames.count = 0;
  for (let step = 0; step < 10; step += 1) sky.update({ ...rests, programs: [step], sidereal: 300 + step / 1000 });
  await new Promise((done) => setTimeout(done, 400));
  found.idleFrames = frames.count;
  const changes = [{ position: { alt: 53, az: 169 } }, { sidereal: 301 }, { limits: { ...mount.limits, lowest: 20 } }];
  found.changedFrames = [];
  for (const change of changes) {
    frames.count = 0;
    sky.update({ ...rests, ...change });
    sky.update({ ...rests, ...change });
    await settled();
    found.changedFrames.push(frames.count);
  }
}

await run().catch((error) => found.errors.push(String(error.stack)));
await fetch("/done", { method: "POST", body: JSON.stringify(found) });
