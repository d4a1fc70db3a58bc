// The run that is at work: stage, clips done, time left, and its output; and how many thumbnails there are.

import { attempt, change, getJson } from "./api.js";
import { el, tell } from "./dom.js";

const place = document.getElementById("run");
const thumbnails = document.getElementById("thumbnails");
const dagster = document.getElementById("dagster");
const dialog = document.getElementById("dialog");

const STOPPED = "the run was stopped";

export class RunState {
  // `onManifests`: called when a run has changed the clips; `onAnswers`: when decisions or proposals changed, wherever.
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
    else place.textContent = "the server has ended";
    this.timer = setTimeout(() => this.poll(), state?.at_work ? 700 : 3000);
  }

  show(state) {
    dagster.href = `http://127.0.0.1:3000/assets/${state.database}`;
    const { made, wanted } = state.thumbnails;
    thumbnails.textContent = made < wanted ? `thumbnails ${made} of ${wanted}` : "";
    if (this.atWork && !state.at_work && state.run) {
      tell(state.status === 0 ? outcome(state.rerun) : state.stopped ? STOPPED : "the run failed; its output tells why", state.status !== 0);
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

// What came of the run. A clip's result is its verdict, its reasons, its figures and its motion.
function outcome(rerun, named = true) {
  if (!rerun) return named ? "the run has ended: the database is up to date" : "materialized";
  if (rerun.error) return `re-run, but the result can't be read: ${rerun.error}`;
  const names = (clips, count) => (named ? ` (${clips.join(", ")}${count > clips.length ? " …" : ""})` : "");
  const part = ({ count, clips }, what) => (count ? [`${count} ${what}${names(clips, count)}`] : []);
  const parts = [...(rerun.unchanged.count ? [`${rerun.unchanged.count} with the same result`] : []),
    ...part(rerun.changed, "with another result"), ...part(rerun.gone, "gone")];
  return `re-run of ${rerun.clips}: ${parts.join("; ")}`;
}

function sentence({ at_work: atWork, status, stopped, seconds, stage, rerun }) {
  if (!atWork) return status === 0 ? outcome(rerun, false) : stopped ? STOPPED : "the run failed";
  const clips = stage.of ? `, ${stage.done} of ${stage.of} clips` : "";
  const left = stage.left_s !== undefined ? `, about ${stage.left_s} s left` : "";
  return `${rerun ? `re-run of ${rerun.clips}: ` : ""}${stage.name ?? "starting"}${clips}${left} (${Math.round(seconds)} s)`;
}
