// Timeline of a clip: foot contacts, parts in the database, and where each criterion fails.

import { el, number } from "./dom.js";

const [LABEL, ROW] = [190, 17];

export class Timeline {
  constructor(details, figures, duration, onSeek) {
    this.rows = rowsOf(details, figures, duration);
    this.duration = duration;
    this.time = 0;
    this.canvas = el("canvas", { class: "timeline", role: "img", "aria-label": this.rows.map(describe).join("; ") });
    this.canvas.style.height = `${this.rows.length * ROW + 18}px`;
    this.canvas.addEventListener("pointerdown", (event) => {
      const box = this.canvas.getBoundingClientRect();
      onSeek(((event.clientX - box.left - LABEL) / Math.max(box.width - LABEL - 8, 1)) * duration);
    });
    this.observer = new ResizeObserver(() => this.draw());
    this.observer.observe(this.canvas);
  }

  remove() { this.observer.disconnect(); }

  show(time) {
    this.time = time;
    this.draw();
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.rows.length * ROW + 18];
    if (!width) return;
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const across = (time) => LABEL + (Math.min(Math.max(time, 0), this.duration) / this.duration) * (width - LABEL - 8);
    context.font = "12px system-ui, sans-serif";
    context.textBaseline = "middle";
    this.rows.forEach((row, place) => {
      const top = place * ROW;
      context.fillStyle = row.color === FAIL ? FAIL : "#445";
      context.fillText(row.label, 0, top + ROW / 2, LABEL - 8);
      context.fillStyle = "#f1f2f5";
      context.fillRect(LABEL, top + 2, width - LABEL - 8, ROW - 4);
      context.fillStyle = row.color;
      for (const [start, stop] of row.spans) context.fillRect(across(start), top + 2, Math.max(across(stop) - across(start), 2), ROW - 4);
    });
    context.fillStyle = "#667";
    const step = [0.5, 1, 2, 5, 10, 20, 60].find((each) => this.duration / each <= 12) ?? 120;
    for (let time = 0; time <= this.duration; time += step) context.fillText(`${number(time)} s`, across(time) - 4, this.rows.length * ROW + 9);
    context.fillStyle = "#16181d";
    context.fillRect(across(this.time) - 0.5, 0, 1.5, this.rows.length * ROW);
  }
}

const FAIL = "#b3261e";

function rowsOf(details, figures, duration) {
  const rows = [];
  for (const figure of figures) {
    if (!figure.contacts) continue;
    ["left", "right"].forEach((side, foot) => rows.push({ label: `${figure.name}: ${side} foot`, color: "#2ca02c", spans: figure.contacts[foot] }));
  }
  if (details.pieces.length) rows.push({ label: "in the database", color: "#2563b8", spans: details.pieces.map((piece) => [piece.start_s, piece.stop_s]) });
  const failures = new Map();
  for (const reason of details.reasons) {
    const label = reason.code.replaceAll("_", " ");
    const start = (reason.start_s ?? details.starts_s) - details.starts_s;
    const span = reason.start_s === undefined ? [0, duration] : [start, (reason.stop_s ?? reason.start_s) - details.starts_s];
    const color = reason.effect === "rejected" ? FAIL : "#a15c00";
    failures.set(label, { label, color, spans: [...(failures.get(label)?.spans ?? []), span] });
  }
  return [...rows, ...failures.values()];
}

function describe(row) {
  return `${row.label} ${row.spans.map(([start, stop]) => `${number(start)} to ${number(stop)} s`).join(", ")}`;
}
