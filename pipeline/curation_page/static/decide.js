// Decisions on clips: asked for with a reason, written by the server, told to the pages that show them.

import { attempt, change, person } from "./api.js";
import { el, tell } from "./dom.js";

const dialog = document.getElementById("dialog");

// Ask for the fields of a form; the values, or null if the person cancels.
export function ask(title, fields, action) {
  return new Promise((resolve) => {
    const inputs = fields.map(({ label, options, value = "" }) => {
      const input = options ? el("select", {}, options.map((each) => el("option", { value: each }, each))) : el("input", { value, maxLength: 400 });
      return { input, element: el("label", {}, label, input) };
    });
    const done = (result) => { dialog.onclose = null; dialog.close(); resolve(result); };
    const ok = el("button", { type: "button", class: "ok", onclick: () => done(inputs.map(({ input }) => input.value.trim())) }, action);
    dialog.replaceChildren(el("h2", {}, title), ...inputs.map(({ element }) => element),
      el("div", { class: "buttons" }, el("button", { type: "button", onclick: () => done(null) }, "cancel"), ok));
    dialog.onclose = () => resolve(null);
    dialog.onkeydown = (event) => { if (event.key === "Enter" && event.target.tagName === "INPUT") { event.preventDefault(); ok.click(); } };
    dialog.showModal();
    inputs[0]?.input.focus();
  });
}

// Accept, exclude or take back decisions on clips. `names`: what else the decision may be about (window, recording).
export async function decide(clips, verdict, names = []) {
  await attempt(async () => {
    if (verdict === "take back") {
      await change("take_back", { clips });
      changed(`${count(clips)}: the decision is taken back; materialize to see its effect`);
      return;
    }
    const by = person();
    const scope = names.length > 1 ? [{ label: "what the decision is about", options: names }] : [];
    const answer = await ask(`${verdict} ${clips.length === 1 ? clips[0] : count(clips)}`, [{ label: "why" }, ...scope], verdict);
    if (!answer) return;
    const [why, what] = answer;
    if (!why) throw new Error("a decision needs a reason");
    const about = what ? [what] : clips;
    await change("decide", { clips: about, verdict, by, why });
    changed(`${count(about)}: ${verdict === "exclude" ? "excluded" : "accepted"}; written to data/curation.yaml`);
  });
}

export async function runAgain() {
  await attempt(async () => {
    await change("run");
    document.dispatchEvent(new CustomEvent("run-started"));
  });
}

// Send clips through all their stages again, from the recording on, whether or not their answers are known.
export async function rerun(clips) {
  await attempt(async () => {
    const started = await change("rerun", { clips });
    tell(`${started === 1 ? clips[0] : `${started} clips`}: every stage works on it again`);
    document.dispatchEvent(new CustomEvent("run-started"));
  });
}

export function changed(text) {
  tell(text);
  document.dispatchEvent(new CustomEvent("decisions-changed"));
}

function count(clips) {
  return clips.length === 1 ? clips[0] : `${clips.length} clips`;
}
