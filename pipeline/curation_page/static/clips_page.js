// Page of all clips: filters and histograms, the gallery, and actions on the selected clips.

import { decide, rerun, runAgain } from "./decide.js";
import { el, tell } from "./dom.js";
import { Gallery } from "./gallery.js";
import { Histogram } from "./histogram.js";
import { Thumbnails } from "./thumbnails.js";

const FACETS = ["source", "skill", "licence", "stage", "verdict", "reason", "decision"];

const PAUSE_MS = 120;
const PIECE_MS = 6;

export class ClipsPage {
  // `kept`: state of this page before the table was read again.
  constructor(table, query, kept) {
    this.table = table;
    this.state = kept ? structuredClone(kept.state) : stated(query);
    this.thumbnails = new Thumbnails();
    this.gallery = new Gallery(table, this.thumbnails, {
      onChosen: () => this.showCounts(),
      onOpen: (index) => { location.hash = `#/clip/${encodeURIComponent(table.clip[index])}`; },
    });
    this.element = this.built();
    this.gallery.chosen = new Set((kept?.chosen ?? []).map((clip) => table.place.get(clip)).filter((index) => index !== undefined));
    this.update();
  }

  kept(selected) { return { state: this.state, top: this.gallery.top, chosen: selected ? this.chosenClips() : [] }; }

  attached({ top }) { this.gallery.goTo(top); }

  leave() {
    clearTimeout(this.filling);
    this.thumbnails.stop();
    this.gallery.remove();
    this.seen.disconnect();
  }

  built() {
    const { table } = this;
    this.search = el("input", { type: "search", placeholder: "search names", value: this.state.query, "aria-label": "search names",
      oninput: () => { this.state.query = this.search.value; this.update(); } });
    this.selects = FACETS.filter((facet) => facet in this.state.texts || table.texts[facet].names.some((name) => name)).map((facet) => {
      const select = el("select", { name: facet, onchange: () => {
        if (select.value) this.state.texts[facet] = table.texts[facet].names[Number(select.value) - 1];
        else delete this.state.texts[facet];
        this.update();
      } });
      return { facet, select };
    });
    this.sort = el("select", { name: "sort", onchange: () => { this.sortBy(this.sort.value); } },
      el("option", { value: "clip" }, "name"), table.figures.map((figure) => el("option", { value: figure.name }, figure.name.replaceAll("_", " "))));
    this.turn = el("button", { title: "reverse the order", onclick: () => { this.state.descending = !this.state.descending; this.update(); } });
    this.histograms = table.figures.map((figure) => new Histogram(figure, {
      onRange: (each, range) => { if (range) this.state.ranges[each.name] = range; else delete this.state.ranges[each.name]; this.update(); },
      onSort: (each) => this.sortBy(each.name),
    }));
    this.seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const found = this.histograms.find((each) => each.element === entry.target);
        found.seen = entry.isIntersecting;
        if (found.seen) found.draw();
      }
    });
    this.histograms.forEach((each) => this.seen.observe(each.element));
    const groups = Map.groupBy ? Map.groupBy(this.histograms, (each) => each.figure.group) : grouped(this.histograms);
    this.count = el("span", { class: "count" });
    this.all = el("button", { onclick: () => this.gallery.chooseAll(this.gallery.chosen.size === 0) }, "select all shown");
    this.acts = [
      el("button", { class: "accept", onclick: () => this.decide("accept") }, "✓ accept"),
      el("button", { class: "exclude", onclick: () => this.decide("exclude") }, "✕ exclude"),
      el("button", { onclick: () => this.decide("take back") }, "undo decision"),
      el("button", { class: "rerun", onclick: () => rerun(this.chosenClips()), title: "process these clips again in every stage, from the recording on" }, "↺ re-run"),
    ];
    return [
      el("aside", { class: "sidebar" }, this.search,
        this.selects.map(({ facet, select }) => el("label", {}, facet, select)),
        el("label", {}, "sort by", el("span", {}, this.sort, this.turn)),
        el("button", { onclick: () => this.clear() }, "clear filters"),
        [...groups].map(([group, histograms]) => el("section", {}, el("h2", {}, group), histograms.map((each) => each.element)))),
      el("section", { class: "gallery" }, el("div", { class: "bar" }, this.count, this.all, this.acts,
        el("button", { onclick: runAgain, title: "run dagster asset materialize: update everything that decisions or settings made stale" }, "↻ materialize")), this.gallery.element),
    ];
  }

  sortBy(name) {
    const figure = this.table.byName.get(name);
    this.state.descending = this.state.sort === name ? !this.state.descending : Boolean(figure) && !figure.lower;
    this.state.sort = name;
    this.update();
  }

  clear() {
    Object.assign(this.state, { query: "", texts: {}, ranges: {} });
    this.search.value = "";
    this.update();
  }

  update() {
    const { state, table } = this;
    const indices = table.chosen(state);
    const figure = table.byName.get(state.sort);
    if (this.gallery.chosen.size) this.gallery.chosen = new Set(indices.filter((index) => this.gallery.chosen.has(index)));
    this.gallery.show(indices, figure);
    this.later(indices, figure);
    this.sort.value = state.sort;
    this.turn.textContent = state.descending ? "↓" : "↑";
    this.showCounts();
  }

  // Update histograms, counts and the address after a pause, in short pieces, so that the next key or click is not delayed.
  later(indices, figure) {
    const shown = indices.length === this.table.count ? null : indices;
    const pieces = [
      ...this.histograms.map((each) => () => each.show(shown, this.state.ranges[each.figure.name], each.figure === figure)),
      ...this.selects.map(({ facet, select }) => () => this.fillSelect(facet, select, indices)),
      () => this.remember(),
    ];
    const work = () => {
      const start = performance.now();
      while (pieces.length && performance.now() - start < PIECE_MS) pieces.shift()();
      if (pieces.length) this.filling = setTimeout(work, 0);
    };
    clearTimeout(this.filling);
    this.filling = setTimeout(work, PAUSE_MS);
  }

  fillSelect(facet, select, indices) {
    const counts = this.table.countsOf(facet, indices);
    const selected = this.state.texts[facet];
    if (selected !== undefined && !counts.some(([name]) => name === selected)) counts.push([selected, 0]);  // no clip has this value now
    select.replaceChildren(el("option", { value: "" }, "all"), ...counts
      .map(([name, count], place) => [name, count, place])
      .filter(([name, count]) => count || name === selected)
      .map(([name, count, place]) => el("option", { value: String(place + 1), selected: name === selected }, `${name || "none"} (${count})`)));
  }

  // Write the filters to the address, so that a view can be bookmarked and linked. Do nothing if a click has already led to
  // another page, whose hashchange event follows.
  remember() {
    if (/^(#\/?)?(\?|$)/.test(location.hash)) history.replaceState(null, "", this.address);
  }

  get address() {
    const { query, texts, ranges, sort, descending } = this.state;
    const shown = new URLSearchParams({ ...(query && { q: query }), ...texts, ...(sort !== "clip" && { sort }), ...(descending && { descending: "1" }) });
    for (const [name, ends] of Object.entries(ranges)) shown.append("range", [name, ...ends.map((end) => (Number.isFinite(end) ? String(Number(end.toPrecision(6))) : ""))].join(":"));
    return `#/${shown.size ? `?${shown}` : ""}`;
  }

  showCounts() {
    const { chosen, indices } = this.gallery;
    this.count.textContent = `${indices.length} of ${this.table.count} clips${chosen.size ? `, ${chosen.size} selected` : ""}`;
    this.all.textContent = chosen.size ? "select none" : "select all shown";
    for (const act of this.acts) act.disabled = chosen.size === 0;
  }

  decide(verdict) {
    if (verdict !== "take back") return decide(this.chosenClips(), verdict);
    const decided = this.chosenClips().filter((clip) => this.table.text("decision", this.table.place.get(clip)));
    return decided.length ? decide(decided, verdict) : tell("none of the selected clips has its own decision", true);
  }

  chosenClips() { return [...this.gallery.chosen].map((index) => this.table.clip[index]); }
}

// Filters in an address; a missing end of a range is infinite.
function stated(query) {
  const texts = Object.fromEntries(FACETS.filter((facet) => query.has(facet)).map((facet) => [facet, query.get(facet)]));
  const ranges = Object.fromEntries(query.getAll("range").map((text) => {
    const [name, low, high] = text.split(":");
    return [name, [low ? Number(low) : -Infinity, high ? Number(high) : Infinity]];
  }).filter(([, ends]) => !ends.some(Number.isNaN)));
  return { query: query.get("q") ?? "", texts, ranges, sort: query.get("sort") ?? "clip", descending: query.get("descending") === "1" };
}

function grouped(histograms) {
  const groups = new Map();
  for (const each of histograms) groups.set(each.figure.group, [...(groups.get(each.figure.group) ?? []), each]);
  return groups;
}
