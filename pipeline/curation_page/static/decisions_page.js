// All decisions on clips in data/curation.yaml, with a button to undo each.

import { getJson } from "./api.js";
import { decide } from "./decide.js";
import { clipLink, el, table } from "./dom.js";

export class DecisionsPage {
  constructor() {
    this.element = el("div", { class: "page" });
  }

  leave() {}

  async load() {
    const found = await getJson("/api/decisions");
    this.element.replaceChildren(el("h1", {}, "Decisions"),
      el("p", { class: "quiet" }, "Stored in data/curation.yaml. When the database is materialized, KP1 leaves out excluded recordings and windows, and KP5 leaves out excluded variants and rollouts."),
      found.length ? table(["clip", "decision", "by", "day", "reason", ""], found.map((each) => [clipLink(each.clip), el("span", { class: each.verdict }, each.verdict), each.by, each.day, each.why,
        el("button", { onclick: () => decide([each.clip], "take back"), "aria-label": `undo ${each.clip}` }, "undo")])) : el("p", { class: "empty" }, "There are no decisions yet."));
  }
}
