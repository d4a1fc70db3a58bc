// Page of one clip: playback, timeline, reasons, criteria, lineage, weights, decisions.

import { getBytes, getJson } from "./api.js";
import { decide, rerun } from "./decide.js";
import { clipLink, el, number, seconds, table } from "./dom.js";
import { parse } from "./lines.js";
import { Player } from "./player.js";
import { Timeline } from "./timeline.js";

export class ClipPage {
  constructor(clip) {
    this.clip = clip;
    this.loading = el("p", { class: "quiet" }, "loading …");
    this.element = el("div", { class: "page" }, this.loading);
  }

  // `motions`: whether to read the motions again too.
  async load(motions = false) {
    if (motions) this.motion = undefined;
    const name = encodeURIComponent(this.clip);
    const details = await getJson(`/api/clip?name=${name}`).catch((error) => { this.loading.remove(); throw error; });
    if (details.made) {
      this.player?.stop();
      this.player = this.timeline = null;
      this.element.replaceChildren(...derivedClips(details));
      return;
    }
    this.motion ??= await getBytes(`/api/motion?name=${name}`).then(parse, (error) => { this.why = error.message; return []; });
    this.show(details);
  }

  leave() {
    this.player?.stop();
    this.timeline?.remove();
    this.left = true;
  }

  show(details) {
    if (this.left) return;
    this.timeline?.remove();
    this.timeline = null;
    if (this.player?.figures !== this.motion) {
      const before = this.player;
      before?.stop();
      this.player = this.motion.length ? new Player(this.motion, (now) => this.timeline?.show(now)) : null;
      if (before) this.player?.takeOver(before);
    }
    if (this.player) {
      this.timeline = new Timeline(details, this.motion, this.player.duration, (to) => this.player.seek(to));
      this.player.show();
    }
    this.element.replaceChildren(
      el("h1", {}, details.clip),
      el("p", {}, el("span", { class: details.verdict }, details.verdict), ` at ${details.stage}, `, details.numbers.skill ?? "", ", ",
        seconds(details.numbers.seconds_in ?? details.numbers.seconds ?? 0), ", source ", details.numbers.source ?? "unknown", ", licence ", details.numbers.licence ?? "unknown"),
      el("div", { class: "controls" },
        el("button", { class: "accept", onclick: () => decide([details.clip], "accept", details.names) }, "✓ accept"),
        el("button", { class: "exclude", onclick: () => decide([details.clip], "exclude", details.names) }, "✕ exclude"),
        el("button", { class: "rerun", onclick: () => rerun([details.clip]), title: "process this clip again in every stage, from the recording on" }, "↺ re-run"),
        decisions(details)),
      this.player?.element ?? el("p", { class: "empty" }, this.why ?? "this clip has no readable motion"),
      this.timeline?.canvas ?? "",
      ...reasons(details, this.player),
      ...criteria(details),
      ...weights(details),
      ...lineage(details),
      el("details", {}, el("summary", {}, "all figures"), table(["figure", "value"], Object.entries(details.numbers).map(([name, value]) => [name, typeof value === "number" ? number(value, 4) : String(value ?? "–")]))),
    );
  }
}

function decisions(details) {
  if (!details.decisions.length) return el("span", { class: "quiet" }, "no decision yet");
  return details.decisions.map((each) => el("span", {}, el("span", { class: each.verdict }, `${each.clip}: ${each.verdict === "exclude" ? "excluded" : "accepted"} by ${each.by} on ${each.day}: ${each.why} `),
    el("button", { onclick: () => decide([each.clip], "take back"), "aria-label": `undo ${each.clip}` }, "undo")));
}

// Page of a recording, window or variant that passed all its stages: the gallery only has the clips derived from it.
function derivedClips(details) {
  const [about] = details.names;
  const more = details.count > details.made.length ? `; the first ${details.made.length}` : "";
  return [
    el("h1", {}, details.clip),
    el("div", { class: "controls" },
      el("button", { class: "accept", onclick: () => decide([about], "accept", details.names) }, "✓ accept"),
      el("button", { class: "exclude", onclick: () => decide([about], "exclude", details.names) }, "✕ exclude"),
      decisions(details)),
    el("p", {}, `${details.count === 1 ? "1 clip was" : `${details.count} clips were`} derived from it${more}:`),
    el("ul", {}, details.made.map((each) => el("li", {}, clipLink(each)))),
  ];
}

function reasons(details, player) {
  if (!details.reasons.length) return [];
  const jump = (reason) => (reason.start_s !== undefined && player
    ? el("button", { onclick: () => { player.seek(reason.start_s - details.starts_s); if (player.playing) player.toggle(); } }, `▸ ${seconds(reason.start_s - details.starts_s)}`)
    : "");
  return [el("h2", {}, "Reasons"), table(["at", "effect", "reason"], details.reasons.map((reason) => [jump(reason), el("span", { class: reason.effect }, reason.effect), reason.text]))];
}

function criteria(details) {
  if (!details.criteria.length) return [];
  const rows = details.criteria.map((row) => [
    `${seconds(row.start_s)} – ${seconds(row.stop_s)}`, row.group, row.criterion, number(row.number), row.threshold === null ? "" : `${row.sense} ${number(row.threshold)}`, row.unit,
    row.margin === null ? "" : `${Math.round(100 * row.margin)} %`, el("span", { class: { broken: "rejected", holds: "accepted" }[row.verdict] ?? "quiet" }, row.verdict), row.message,
  ]);
  const broken = details.criteria.filter((row) => row.verdict === "broken").length;
  return [el("details", { open: broken > 0 }, el("summary", {}, el("strong", {}, `Criteria: ${broken} broken of ${details.criteria.length}`)),
    table(["stretch", "group", "criterion", "number", "threshold", "unit", "margin", "verdict", "message"], rows, [3]))];
}

function weights(details) {
  if (!details.pieces.length) return [];
  return [el("h2", {}, "In the database"), table(["clip", "from", "to", "weight", "family"], details.pieces.map((piece) => [piece.clip, seconds(piece.start_s), seconds(piece.stop_s), number(piece.weight), piece.family ?? ""]), [3])];
}

function lineage(details) {
  const asset = (stage) => el("a", { href: `http://127.0.0.1:3000/assets/${details.assets[stage]}`, target: "_blank", rel: "noopener noreferrer" }, stage);
  const rows = details.lineage.map((step) => [asset(step.stage), step.clip === details.clip ? step.clip : clipLink(step.clip), step.fate, step.reasons.map((reason) => reason.text).join(" ")]);
  return [el("h2", {}, "Lineage"), table(["stage", "clip", "result", "reasons"], rows)];
}
