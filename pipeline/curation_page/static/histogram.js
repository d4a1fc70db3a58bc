// Histogram of a figure with its threshold. Drag to filter by a range, click the title to sort.

import { el, number } from "./dom.js";
import { ends, histogram } from "./table.js";

const BINS = 44;
const [WIDTH, HEIGHT] = [252, 40];

export class Histogram {
  constructor(figure, { onRange, onSort }) {
    this.figure = figure;
    this.range = null;
    this.indices = null;
    this.canvas = el("canvas", { width: 2 * WIDTH, height: 2 * HEIGHT, role: "img", "aria-label": `histogram of ${figure.name}` });
    this.mark = el("span", { class: "quiet" });
    const [low, high] = ends(figure);
    this.element = el("div", { class: "figure", "data-figure": figure.name },
      el("div", { class: "title" }, el("button", { title: "sort by this figure, worst first", onclick: () => onSort(figure) }, figure.name.replaceAll("_", " ")), this.mark),
      this.canvas,
      el("div", { class: "ends" }, el("span", {}, number(low)), el("span", {}, limits(figure)), el("span", {}, `${number(high)} ${figure.unit}`)));
    this.all = histogram(figure, null, BINS);
    this.seen = false;
    let from = null;
    const value = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return low + ((high - low) * Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1));
    };
    this.canvas.addEventListener("pointerdown", (event) => { from = value(event); this.canvas.setPointerCapture(event.pointerId); });
    this.canvas.addEventListener("pointermove", (event) => {
      if (from === null) return;
      this.range = [Math.min(from, value(event)), Math.max(from, value(event))];
      this.draw();
    });
    this.canvas.addEventListener("pointerup", (event) => {
      const to = value(event);
      const wide = Math.abs(to - from) > 0.01 * (high - low);
      const open = ([start, stop]) => [start <= low + 0.01 * (high - low) ? -Infinity : start, stop >= high - 0.01 * (high - low) ? Infinity : stop];
      this.range = wide ? open([Math.min(from, to), Math.max(from, to)]) : null;
      from = null;
      onRange(figure, this.range);
    });
  }

  show(indices, range, sorted) {
    this.indices = indices;
    this.range = range ?? null;
    this.element.classList.toggle("sorted", sorted);
    this.mark.textContent = this.range ? "range ✕" : "";
    if (this.seen) this.draw();
  }

  draw() {
    const context = this.canvas.getContext("2d");
    const [width, height] = [this.canvas.width, this.canvas.height];
    const [low, high] = ends(this.figure);
    const across = (value) => Math.min(Math.max(((value - low) / (high - low)) * width, 0), width);
    context.clearRect(0, 0, width, height);
    if (this.range) {
      context.fillStyle = "#dbe8fa";
      context.fillRect(across(this.range[0]), 0, across(this.range[1]) - across(this.range[0]), height);
    }
    const most = Math.sqrt(Math.max(...this.all, 1));
    const bars = (counts, color) => {
      context.fillStyle = color;
      counts.forEach((count, bin) => {
        const tall = (Math.sqrt(count) / most) * (height - 4);
        if (count) context.fillRect((bin * width) / BINS + 1, height - Math.max(tall, 3), width / BINS - 2, Math.max(tall, 3));
      });
    };
    bars(this.all, "#c9cdd5");
    if (this.indices) bars(histogram(this.figure, this.indices, BINS), "#2563b8");
    if (this.figure.thresholds) {
      const [first, last] = this.figure.thresholds.map(across);
      context.fillStyle = "rgba(179, 38, 30, .18)";
      context.fillRect(first, 0, last - first, height);
      context.fillStyle = "#b3261e";
      for (const place of new Set([first, last])) context.fillRect(place - 1, 0, 3, height);
    }
  }
}

function limits(figure) {
  if (!figure.thresholds) return "";
  const [low, high] = figure.thresholds;
  return `${figure.lower ? "≥" : "≤"} ${low === high ? number(low) : `${number(low)} … ${number(high)}`}`;
}
