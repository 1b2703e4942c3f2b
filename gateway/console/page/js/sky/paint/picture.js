/**
 * Draws one picture of the sky from back to front. Text is placed in order of importance and written last.
 */
import { figureNames, figures } from "./figures.js";
import { bodies, bodyNames } from "./bodies.js";
import { forbidden, Hatching, withinSky } from "./forbidden.js";
import { compass, disk, grid, ringNames } from "./ground.js";
import { FONT, Labels } from "./labels.js";
import { chosen, cursor, target, trail, tube, way } from "./mount.js";
import { glow, project, starNames, stars } from "./stars.js";

const NO_SKY = "No stars are shown until a site and a time are known.";

export class Picture {
  /** @param {HTMLCanvasElement} canvas @param {import("../view.js").View} view */
  constructor(canvas, view) {
    this.context = canvas.getContext("2d");
    this.view = view;
    this.labels = new Labels(this.context, view);
    this.hatching = new Hatching();
    this.points = new Float64Array(0);
  }

  /**
   * @param {{scene: import("../scene.js").Scene, catalogue: import("../catalogue.js").Catalogue|null,
   *   colours: Record<string, string>, density: number, trail: import("../trail.js").Trail, time: number,
   *   chosen: {at: number[], name: string}|null, cursor: number[]|null, covered: number[][]}} state
   */
  draw(state) {
    const { context, view, labels, hatching } = this;
    const brush = { ...state, context, view, labels, hatching, points: this.points };
    const starry = state.catalogue && state.scene.sky;
    if (starry) {
      if (this.points.length !== state.catalogue.count * 3) this.points = new Float64Array(state.catalogue.count * 3);
      brush.points = this.points;
      project(brush, this.points);
    }
    context.setTransform(state.density, 0, 0, state.density, 0, 0);
    context.clearRect(0, 0, view.width, view.height);
    labels.begin(state.covered, state.colours.shade);
    disk(brush);
    withinSky(context, view);
    grid(brush);
    if (starry) figures(brush);
    forbidden(brush);
    if (starry) {
      glow(brush);
      stars(brush);
    }
    trail(brush);
    way(brush);
    context.restore();
    compass(brush);
    bodies(brush);
    target(brush);
    tube(brush);
    chosen(brush);
    bodyNames(brush);
    if (starry) {
      starNames(brush);
      ringNames(brush);
      figureNames(brush);
    } else if (!state.scene.sky) explain(brush);
    cursor(brush);
  }
}

/** Write why there are no stars, in the lower half of the disk. */
function explain({ context, view, colours }) {
  context.font = `13px ${FONT}`;
  context.fillStyle = colours.letters;
  context.textAlign = "center";
  context.textBaseline = "middle";
  let line = "", y = view.y + view.radius * 0.3;
  for (const word of NO_SKY.split(" ")) {
    if (context.measureText(`${line} ${word}`).width > view.radius * 1.4) {
      context.fillText(line, view.x, y);
      [line, y] = [word, y + 18];
    } else line = line ? `${line} ${word}` : word;
  }
  context.fillText(line, view.x, y);
}
