// Grid of clips. Only cards in view exist; scrolling reuses them.

import { el, number, seconds } from "./dom.js";

const SHARP = Math.min(devicePixelRatio || 1, 2);
const [CARD_WIDTH, CARD_HEIGHT, GAP] = [222, 196, 10];

export class Gallery {
  constructor(table, thumbnails, { onChosen, onOpen }) {
    Object.assign(this, { table, thumbnails, onChosen, onOpen });
    this.indices = new Uint32Array(0);
    this.chosen = new Set();
    this.cards = new Map();
    this.free = [];
    this.spacer = el("div");
    this.element = el("div", { class: "grid", tabIndex: 0, role: "list", "aria-label": "clips" }, this.spacer);
    [this.width, this.height, this.top] = [0, 0, 0];  // cached: reading them from the element forces a layout
    this.element.addEventListener("scroll", () => {
      this.top = this.element.scrollTop;
      thumbnails.quietUntil = performance.now() + 150;
      this.schedule();
    });
    this.element.addEventListener("focusout", () => this.schedule());  // a card that was kept because it had the focus can be reused
    this.observer = new ResizeObserver(() => {
      [this.width, this.height] = [this.element.clientWidth, this.element.clientHeight];
      this.render();
    });
    this.observer.observe(this.element);
  }

  remove() { this.observer.disconnect(); }

  show(indices, figure) {
    this.indices = indices;
    this.figure = figure;
    for (const card of this.cards.values()) card.index = -1;
    if (this.top > 0) this.element.scrollTop = this.top = 0;
    this.render();
  }

  // Restore a scroll position; the gallery must be attached to the page.
  goTo(top) {
    [this.width, this.height] = [this.element.clientWidth, this.element.clientHeight];
    this.render();
    this.element.scrollTop = top;
    this.top = this.element.scrollTop;
    this.render();
  }

  schedule() {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => { this.scheduled = false; this.render(); });
  }

  render() {
    const columns = Math.max(Math.floor((this.width - GAP) / (CARD_WIDTH + GAP)), 1);
    const pitch = CARD_HEIGHT + GAP;
    this.spacer.style.height = `${Math.ceil(this.indices.length / columns) * pitch + GAP}px`;
    const { top } = this;
    const first = Math.max(Math.floor((top - GAP) / pitch), 0) * columns;
    const last = Math.min(Math.ceil((top + this.height) / pitch) * columns, this.indices.length);
    for (const [place, card] of this.cards) {
      if (place >= first && place < last) continue;
      if (card.index >= 0 && card.element.contains(document.activeElement)) continue;  // keep the focused card on its clip
      this.cards.delete(place);
      card.element.remove();
      this.free.push(card);
    }
    for (let place = first; place < last; place += 1) {
      const card = this.cards.get(place) ?? this.takeCard(place);
      card.element.style.transform = `translate(${GAP + (place % columns) * (CARD_WIDTH + GAP)}px, ${GAP + Math.floor(place / columns) * pitch}px)`;
      if (card.index !== this.indices[place]) this.fill(card, this.indices[place]);
      card.element.classList.toggle("chosen", this.chosen.has(card.index));
      card.box.checked = this.chosen.has(card.index);
    }
    this.inOrder();
    const key = [...this.cards.values()].map((card) => card.key).join();
    if (key !== this.shown) {
      this.shown = key;
      this.thumbnails.show([...this.cards.values()]);
    }
  }

  // Keep the elements in the order of the clips, for the Tab key. Only new elements are inserted, because moving the focused
  // one would remove its focus.
  inOrder() {
    let next = null;
    for (const [, { element }] of [...this.cards].sort(([one], [two]) => two - one)) {
      if (element.parentNode !== this.element) this.element.insertBefore(element, next);
      next = element;
    }
  }

  takeCard(place) {
    const card = this.free.pop() ?? this.makeCard();
    this.cards.set(place, card);
    return card;
  }

  makeCard() {
    const card = { index: -1 };
    card.canvas = el("canvas", { width: Math.round(220 * SHARP), height: Math.round(124 * SHARP), onclick: () => this.onOpen(card.index) });
    card.box = el("input", { type: "checkbox", onclick: (event) => this.choose(card.index, event.shiftKey) });
    card.name = el("a", { class: "name" });
    card.verdict = el("span");
    card.skill = el("span");
    card.value = el("span", { class: "value" });
    card.decision = el("span", { class: "decision" });
    card.element = el("div", { class: "card", role: "listitem" }, card.canvas, card.box, card.decision, card.name,
      el("div", { class: "facts" }, card.verdict, card.skill, card.value));
    return card;
  }

  fill(card, index) {
    const { table } = this;
    card.index = index;
    card.key = table.thumbnail[index];
    card.name.textContent = table.clip[index];
    card.name.title = table.clip[index];
    card.name.href = `#/clip/${encodeURIComponent(table.clip[index])}`;
    const verdict = table.text("verdict", index);
    card.verdict.textContent = verdict;
    card.verdict.className = verdict;
    card.skill.textContent = table.text("skill", index);
    const value = this.figure?.values[index];
    card.value.textContent = this.figure
      ? `${number(value)} ${this.figure.unit}`
      : seconds(table.byName.get("seconds")?.values[index] ?? 0);
    const decision = table.text("decision", index);
    card.decision.textContent = { accept: "✓ accepted", exclude: "✕ excluded" }[decision] ?? "";
    card.decision.className = `decision ${decision}`;
    card.decision.hidden = !decision;
    card.box.setAttribute("aria-label", `select ${table.clip[index]}`);
  }

  // Toggle a clip; with the Shift key, all clips from the last one to this one.
  choose(index, range) {
    const place = this.indices.indexOf(index);
    const last = range ? this.indices.indexOf(this.last) : -1;  // -1 if it is filtered out
    const from = last >= 0 ? last : place;
    const take = !this.chosen.has(index);
    for (let each = Math.min(from, place); each <= Math.max(from, place); each += 1) {
      if (take) this.chosen.add(this.indices[each]);
      else this.chosen.delete(this.indices[each]);
    }
    this.last = index;
    this.render();
    this.onChosen();
  }

  chooseAll(take) {
    this.chosen = new Set(take ? this.indices : []);
    this.render();
    this.onChosen();
  }
}
