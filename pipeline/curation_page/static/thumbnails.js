// Thumbnails of the clips in view: fetched a few at a time, cached in memory, drawn in turn.

import { draw, frontRight, height, middle, parse } from "./lines.js";

const KEPT = 800;
const AT_ONCE = 6;
const BUDGET_MS = 10;
const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;

export class Thumbnails {
  constructor() {
    this.figures = new Map();
    this.waiting = new Map();
    this.due = new Set();
    this.busy = 0;
    this.cards = [];
    this.next = 0;
    this.quietUntil = 0;
    this.timer = setInterval(() => this.tick(), 100);
  }

  stop() { clearInterval(this.timer); }

  // Set the cards in view ({key, canvas}). Pending fetches for other cards are dropped.
  show(cards) {
    this.cards = cards;
    const visible = new Set(cards.map((card) => card.key));
    for (const key of this.waiting.keys()) if (!visible.has(key)) this.waiting.delete(key);
    this.due.clear();
    for (const card of cards) {
      if (this.figures.has(card.key)) this.due.add(card);
      else {
        card.canvas.getContext("2d").clearRect(0, 0, card.canvas.width, card.canvas.height);
        delete card.canvas.dataset.drawn;
        this.waiting.set(card.key, true);
      }
    }
    this.fetchMore();
    this.paintSoon();
  }

  // Spread painting over several frames, so that it does not delay scrolling and filtering.
  paintSoon() {
    if (this.painting || !this.due.size) return;
    this.painting = true;
    requestAnimationFrame(() => {
      this.painting = false;
      const start = performance.now();
      for (const card of this.due) {
        this.due.delete(card);
        if (this.cards.includes(card)) this.paint(card);
        if (performance.now() - start > BUDGET_MS) break;
      }
      this.paintSoon();
    });
  }

  fetchMore() {
    for (const key of this.waiting.keys()) {
      if (this.busy >= AT_ONCE) return;
      this.waiting.delete(key);
      this.busy += 1;
      fetch(`/thumbnails/${key}`)
        .then((response) => (response.ok ? response.arrayBuffer() : new ArrayBuffer(0)))
        .then((buffer) => this.keep(key, parse(buffer)))
        .catch(() => this.keep(key, []))
        .finally(() => { this.busy -= 1; this.fetchMore(); });
    }
  }

  keep(key, figures) {
    this.figures.set(key, figures);
    if (this.figures.size > KEPT) this.figures.delete(this.figures.keys().next().value);
    for (const card of this.cards) if (card.key === key) this.due.add(card);
    this.paintSoon();
  }

  tick() {
    const start = performance.now();
    if (document.hidden || calm || start < this.quietUntil || !this.cards.length) return;
    for (let count = 0; count < this.cards.length && performance.now() - start < BUDGET_MS; count += 1) {
      this.paint(this.cards[this.next % this.cards.length]);
      this.next += 1;
    }
  }

  paint({ key, canvas }) {
    const figures = this.figures.get(key);
    if (!figures) return;
    const context = canvas.getContext("2d");
    const [width, tall] = [canvas.width, canvas.height];
    context.clearRect(0, 0, width, tall);
    const time = calm ? 0 : performance.now() / 1000;
    let drawn = false;
    figures.forEach((figure, place) => {
      const frame = figure.frames > 1 ? Math.floor(time * figure.fps) % figure.frames : 0;
      const root = middle(figure, frame);
      if (!root) return;
      const top = height(figure);
      const x = ((place + 0.5) * width) / figures.length;
      const camera = { azimuth: frontRight(figure), elevation: 0.2, scale: (0.82 * tall) / Math.max(top, 1.25), focus: [root[0], root[1], 0], x, y: 0.93 * tall };
      context.fillStyle = "#e3e6ea";
      context.beginPath();
      context.ellipse(x, camera.y, 0.28 * camera.scale, 0.09 * camera.scale, 0, 0, 2 * Math.PI);
      context.fill();
      drawn = draw(context, figure, frame, camera) || drawn;
    });
    canvas.dataset.drawn = drawn ? key : "nothing";
    if (!drawn) {
      context.fillStyle = "#889";
      context.font = `${Math.round(tall / 11)}px sans-serif`;
      context.fillText("no readable motion", 12, tall / 2);
    }
  }
}
