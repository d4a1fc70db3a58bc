// Comparison of two versions of the database: added clips, removed clips with reasons, changed weights.

import { attempt, getJson } from "./api.js";
import { clipLink, el, number, seconds, table } from "./dom.js";

export class DatabasesPage {
  constructor() {
    this.element = el("div", { class: "page" });
  }

  leave() {}

  // `motions`: whether a run has ended, so that the newest versions are selected.
  async load(motions = false) {
    const versions = await getJson("/api/databases");
    if (!versions.length) {
      this.element.replaceChildren(el("h1", {}, "Databases"), el("p", { class: "empty" }, "This robot has no database yet; materialize it."));
      return;
    }
    const kept = (select) => (motions ? undefined : versions.find((each) => each.name === select?.value)?.name);
    const [before, after] = [kept(this.before) ?? versions[1]?.name ?? versions[0].name, kept(this.after) ?? versions[0].name];
    const options = (selected) => versions.map((each) => el("option", { value: each.name, selected: each.name === selected }, `${each.name}: ${each.clips} clips, ${seconds(each.seconds)}`));
    const show = () => attempt(() => this.compare());
    this.before = el("select", { name: "before", onchange: show }, options(before));
    this.after = el("select", { name: "after", onchange: show }, options(after));
    this.found = el("div");
    this.element.replaceChildren(el("h1", {}, "Databases"), el("div", { class: "controls" }, el("label", {}, "from ", this.before), el("label", {}, "to ", this.after)), this.found);
    await this.compare();
  }

  async compare() {
    const query = new URLSearchParams({ before: this.before.value, after: this.after.value });
    const found = await getJson(`/api/compare?${query}`);
    const skills = [...new Set([...Object.keys(found.before.seconds_by_skill), ...Object.keys(found.after.seconds_by_skill)])].sort();
    const bySkill = skills.map((skill) => [skill, number(found.before.seconds_by_skill[skill] ?? 0, 5), number(found.after.seconds_by_skill[skill] ?? 0, 5)]);
    this.found.replaceChildren(
      el("p", { class: "summary" }, `${found.came.length} clips added, ${found.left.length} removed, ${found.changed} with changed motion, ${found.weights_changed} with changed weight`),
      el("h2", {}, "Removed clips"), found.left.length ? table(["clip", "skill", "seconds", "reason"], found.left.map((row) => [clipLink(row.clip), row.skill, number(row.seconds), row.why]), [2]) : "none",
      el("h2", {}, "Added clips"), found.came.length ? table(["clip", "skill", "seconds", "weight"], found.came.map((row) => [clipLink(row.clip), row.skill, number(row.seconds), number(row.weight)]), [2, 3]) : "none",
      el("h2", {}, "Seconds by skill"), table(["skill", "before", "after"], bySkill, [1, 2]),
      el("h2", {}, "Largest changes of weight"), found.weighted.length ? table(["clip", "before", "after"], found.weighted.slice(0, 50).map((row) => [clipLink(row.clip), number(row.before), number(row.after)]), [1, 2]) : "none",
    );
  }
}
