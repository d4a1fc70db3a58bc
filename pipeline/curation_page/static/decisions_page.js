// Every decision on clips, as data/curation.yaml has them, each of which can be taken back.

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
      el("p", { class: "quiet" }, "In data/curation.yaml. An excluded recording or window is left out by KP1, an excluded variant or rollout by KP5, when the database is materialized."),
      found.length ? table(["clip", "decision", "by", "day", "why", ""], found.map((each) => [clipLink(each.clip), el("span", { class: each.verdict }, each.verdict), each.by, each.day, each.why,
        el("button", { onclick: () => decide([each.clip], "take back"), "aria-label": `undo ${each.clip}` }, "undo")])) : el("p", { class: "empty" }, "No decision was made yet."));
  }
}
