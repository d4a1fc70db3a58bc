// State of the run in progress (stage, clips done, time left, output) and progress of the thumbnails.

import { attempt, change, getJson } from "./api.js";
import { el, tell } from "./dom.js";

const place = document.getElementById("run");
const thumbnails = document.getElementById("thumbnails");
const dagster = document.getElementById("dagster");
const dialog = document.getElementById("dialog");

const STOPPED = "the run was stopped";

export class RunState {
  // `onManifests`: called after a run changed the clips. `onAnswers`: called after any program changed decisions or proposals.
  constructor(onManifests, onAnswers) {
    Object.assign(this, { onManifests, onAnswers });
    [this.version, this.answers] = [null, null];
    this.text = el("span", { class: "quiet" });
    this.output = el("button", { onclick: () => attempt(() => this.showLog()) }, "output");
    this.end = el("button", { onclick: () => attempt(() => change("stop")) }, "stop");
    document.addEventListener("run-started", () => this.poll());
    this.poll();
  }

  async poll() {
    clearTimeout(this.timer);
    const state = await getJson("/api/state").catch(() => null);
    if (state) this.show(state);
    else place.textContent = "the server does not respond";
    this.timer = setTimeout(() => this.poll(), state?.at_work ? 700 : 3000);
  }

  show(state) {
    dagster.href = `http://127.0.0.1:3000/assets/${state.database}`;
    const { made, total } = state.thumbnails;
    thumbnails.textContent = made < total ? `thumbnails ${made} of ${total}` : "";
    if (this.atWork && !state.at_work && state.run) {
      tell(state.status === 0 ? outcome(state.rerun) : state.stopped ? STOPPED : "the run failed; see its output", state.status !== 0);
    }
    if (this.version !== null && state.version !== this.version && !state.at_work) this.onManifests();
    else if (this.answers !== null && state.answers !== this.answers) this.onAnswers();
    if (!state.at_work) this.version = state.version;
    this.answers = state.answers;
    this.atWork = state.at_work;
    place.dataset.status = state.at_work ? "at work" : state.status === null ? "" : state.status === 0 ? "done" : state.stopped ? "stopped" : "failed";
    if (!state.run) { place.replaceChildren(); return; }
    this.text.textContent = sentence(state);
    this.end.hidden = !state.at_work;
    if (!this.output.isConnected) place.replaceChildren(this.text, " ", this.output, this.end);
    if (this.log?.isConnected) this.log.textContent = state.lines.join("\n");
  }

  async showLog() {
    const state = await getJson("/api/state");
    this.log = el("pre", { class: "log" }, state.lines.join("\n"));
    dialog.onkeydown = null;
    dialog.replaceChildren(el("h2", { id: "asked" }, "dagster asset materialize"), this.log, el("div", { class: "buttons" }, el("button", { onclick: () => dialog.close() }, "close")));
    dialog.showModal();
    this.log.scrollTop = this.log.scrollHeight;
  }
}

// Message about a finished run. The result of a clip is its verdict, reasons, figures and motion.
function outcome(rerun, named = true) {
  if (!rerun) return named ? "the run has ended: the database is up to date" : "materialized";
  if (rerun.error) return `re-run ended, but its result can't be read: ${rerun.error}`;
  const names = (clips, count) => (named ? ` (${clips.join(", ")}${count > clips.length ? " …" : ""})` : "");
  const part = ({ count, clips }, what) => (count ? [`${count} ${what}${names(clips, count)}`] : []);
  const parts = [...(rerun.unchanged.count ? [`${rerun.unchanged.count} with the same result`] : []),
    ...part(rerun.changed, "with a different result"), ...part(rerun.gone, "missing")];
  return `re-run of ${rerun.clips}: ${parts.join("; ")}`;
}

function sentence({ at_work: atWork, status, stopped, seconds, stage, rerun }) {
  if (!atWork) return status === 0 ? outcome(rerun, false) : stopped ? STOPPED : "the run failed";
  const clips = stage.of ? `, ${stage.done} of ${stage.of} clips` : "";
  const left = stage.left_s !== undefined ? `, about ${stage.left_s} s left` : "";
  return `${rerun ? `re-run of ${rerun.clips}: ` : ""}${stage.name ?? "starting"}${clips}${left} (${Math.round(seconds)} s)`;
}
