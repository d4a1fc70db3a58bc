// Proposed changes with their evidence, and buttons to approve or decline them by the digest of the proposal.

import { attempt, change, getJson, person } from "./api.js";
import { changed } from "./decide.js";
import { el, number, table } from "./dom.js";

export class ProposalsPage {
  constructor() {
    this.element = el("div", { class: "page" });
  }

  leave() {}

  async load() {
    const found = await getJson("/api/proposals");
    const sections = [...new Set(found.changes.map((each) => each.section))];
    this.element.replaceChildren(
      el("h1", {}, "Proposals"),
      el("p", { class: "quiet" }, "Changes proposed from the failures in data/hardware_logs, bounded by data/feedback_rules.yaml. A change takes effect after you approve it and materialize the database."),
      ...found.faults.map((fault) => el("p", { class: "rejected" }, fault)),
      found.proposal ? el("p", {}, "proposal ", el("code", {}, found.proposal)) : el("p", { class: "empty" }, found.missing || "There are no proposed changes."),
      ...sections.map((section) => this.section(found, section)),
      ...(found.approved.length ? [el("h2", {}, "Approved"), table(["section", "by", "proposal", "changes", ""], found.approved.map((each) => [each.section, each.by, each.proposal, String(each.changes),
        el("button", { onclick: () => this.answer("take_back_sections", { sections: [each.section] }, "revoked"), "aria-label": `take back ${each.section}` }, "take back")]), [3])] : []),
      ...(found.lingering.length ? [el("h2", {}, "Approved, no longer proposed"), ...found.lingering.map(shown)] : []),
    );
  }

  section(found, section) {
    const own = found.changes.filter((each) => each.section === section);
    const about = { proposal: found.proposal, sections: [section] };
    const pending = own.some((each) => each.answer !== "approved");
    return el("section", { "data-section": section }, el("h2", {}, `${section}: ${found.sections[section]}`), own.map(shown),
      el("div", { class: "controls" },
        el("button", { class: "accept", disabled: !pending, onclick: () => this.answer("approve", about, "approved") }, `approve ${section}`),
        el("button", { class: "exclude", disabled: !own.some((each) => each.answer === "pending"), onclick: () => this.answer("decline", about, "declined") }, `decline ${section}`)));
  }

  async answer(action, value, done) {
    await attempt(async () => {
      const count = await change(action, { ...value, by: person() });
      await this.load();
      changed(`${count} changes ${done}`);
    });
  }
}

function shown(each) {
  const answer = { approved: "accepted", declined: "rejected", pending: "quiet" }[each.answer];
  return el("div", { class: "change" },
    el("div", {}, el("strong", {}, each.what), ` (${each.robot}): ${number(each.before)} → `, el("strong", {}, number(each.value)), `, limit ${number(each.bound)}, evidence: ${each.counted} `,
      el("span", { class: answer }, each.answer), each.demonstration ? el("span", { class: "quiet" }, " based only on the shipped demonstration logs") : ""),
    table(["log", "trial", "policy", "evidence"], each.evidence.map((one) => [
      el("span", { title: `SHA-256 ${one.sha256}` }, one.log, one.simulated ? " (simulated)" : ""), one.trial, el("code", { title: one.policy }, one.policy.slice(0, 12)), one.text])));
}
