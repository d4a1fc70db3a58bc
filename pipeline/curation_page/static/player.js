// Playback of a clip's figures side by side with a common clock and camera. Drag to turn, scroll to zoom.

import { el, seconds } from "./dom.js";
import { draw, drawGround, frameAt, frontRight, height, middle } from "./lines.js";

const [WIDTH, HEIGHT] = [380, 340];

export class Player {
  constructor(figures, onTime) {
    this.figures = figures;
    this.onTime = onTime;
    this.duration = Math.max(...figures.map((figure) => figure.duration), 0.01);
    this.time = 0;
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.turned = 0;
    this.elevation = 0.22;
    this.zoom = 1;
    this.canvases = figures.map((figure) => el("canvas", { width: 2 * WIDTH, height: 2 * HEIGHT, "aria-label": `playback of ${figure.name}` }));
    for (const canvas of this.canvases) {
      canvas.style.width = `${WIDTH}px`;
      this.listen(canvas);
    }
    this.play = el("button", { onclick: () => this.toggle() }, this.playing ? "pause" : "play");
    this.slider = el("input", { type: "range", min: 0, max: this.duration, step: 0.01, value: 0, "aria-label": "time",
      oninput: () => this.seek(Number(this.slider.value)) });
    this.speed = el("select", { "aria-label": "speed" }, ["0.1", "0.25", "0.5", "1", "2"].map((text) => el("option", { selected: text === "1" }, text)));
    this.clock = el("span", { class: "quiet" });
    this.follow = el("input", { type: "checkbox", checked: true, onchange: () => this.show() });
    this.element = el("div", {},
      el("div", { class: "stages" }, figures.map((figure, place) => el("figure", {}, this.canvases[place], el("figcaption", {}, figure.name)))),
      el("div", { class: "controls" }, this.play, this.slider, this.clock, el("label", {}, "speed ", this.speed), el("label", {}, this.follow, " follow")));
    this.last = performance.now();
    this.running = true;
    const tick = (now) => {
      if (!this.running) return;
      if (this.playing) {
        this.time = (this.time + ((now - this.last) / 1000) * Number(this.speed.value)) % this.duration;
        this.show();
      }
      this.last = now;
      requestAnimationFrame(tick);
    };
    this.show();
    requestAnimationFrame(tick);
  }

  stop() { this.running = false; }

  // Take over time, speed and camera from another player of the same clip.
  takeOver({ time, playing, turned, elevation, zoom, speed, follow }) {
    Object.assign(this, { turned, elevation, zoom });
    this.speed.value = speed.value;
    this.follow.checked = follow.checked;
    if (playing !== this.playing) this.toggle();
    this.seek(time);
  }

  toggle() {
    this.playing = !this.playing;
    this.play.textContent = this.playing ? "pause" : "play";
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.show();
  }

  listen(canvas) {
    let from = null;
    canvas.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      this.turned -= (event.clientX - from[0]) * 0.01;
      this.elevation = Math.min(Math.max(this.elevation + (event.clientY - from[1]) * 0.006, -0.1), 1.5);
      from = [event.clientX, event.clientY];
      this.show();
    });
    canvas.addEventListener("pointerup", () => { from = null; });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom = Math.min(Math.max(this.zoom * Math.exp(-event.deltaY * 0.001), 0.2), 5);
      this.show();
    }, { passive: false });
  }

  show() {
    this.figures.forEach((figure, place) => {
      const canvas = this.canvases[place];
      const context = canvas.getContext("2d");
      context.clearRect(0, 0, canvas.width, canvas.height);
      const frame = frameAt(figure, this.time);
      const start = middle(figure, 0) ?? [0, 0];
      const [x, y] = (this.follow.checked ? middle(figure, frame) : start) ?? start;
      const camera = { azimuth: frontRight(figure) + this.turned, elevation: this.elevation, focus: [x, y, 0],
        scale: (0.72 * canvas.height * this.zoom) / Math.max(height(figure), 1.2), x: canvas.width / 2, y: 0.86 * canvas.height };
      drawGround(context, camera);
      canvas.dataset.drawn = draw(context, figure, frame, camera) ? String(frame) : "";
    });
    this.slider.value = this.time;
    this.clock.textContent = `${seconds(this.time)} of ${seconds(this.duration)}`;
    this.onTime(this.time);
  }
}
