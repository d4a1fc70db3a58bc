// Decisions on clips: a dialog for the reason, the request to the server, and an event that updates the pages.

import { attempt, change, person } from "./api.js";
import { el, tell } from "./dom.js";

const dialog = document.getElementById("dialog");

// Show a form and call `work` with its values. The form stays open, with its input, until `work` succeeds; `work` resolves
// to the message to show.
function ask(title, fields, action, work) {
  const inputs = fields.map(({ label, options }) => {
    const input = options ? el("select", {}, options.map((each) => el("option", { value: each }, each))) : el("input", { maxLength: 400 });
    return { input, element: el("label", {}, label, input) };
  });
  const error = el("p", { class: "rejected", role: "alert" });
  const ok = el("button", { type: "button", class: "ok", onclick: async () => {
    ok.disabled = true;
    error.textContent = "";
    try {
      const done = await work(...inputs.map(({ input }) => input.value.trim()));
      if (ok.isConnected) dialog.close();
      changed(done);
    } catch (failure) {
      error.textContent = failure.message;
    }
    ok.disabled = false;
  } }, action);
  dialog.replaceChildren(el("h2", { id: "asked" }, title), ...inputs.map(({ element }) => element), error,
    el("div", { class: "buttons" }, el("button", { type: "button", onclick: () => dialog.close() }, "cancel"), ok));
  dialog.onkeydown = (event) => { if (event.key === "Enter" && !event.isComposing && event.target.tagName === "INPUT") { event.preventDefault(); ok.click(); } };
  dialog.showModal();
  inputs[0]?.input.focus();
}

// Accept or exclude clips, or undo decisions. `names`: alternatives that the decision can apply to (window, recording).
export async function decide(clips, verdict, names = []) {
  await attempt(async () => {
    if (verdict === "take back") {
      await change("take_back", { clips });
      changed(`${count(clips)}: decision removed; materialize to apply it`);
      return;
    }
    const by = person();
    const scope = names.length > 1 ? [{ label: "apply to", options: names }] : [];
    ask(`${verdict} ${count(clips)}`, [{ label: "reason" }, ...scope], verdict, async (why, what) => {
      if (!why) throw new Error("a decision needs a reason");
      const about = what ? [what] : clips;
      await change("decide", { clips: about, verdict, by, why });
      return `${count(about)}: ${verdict === "exclude" ? "excluded" : "accepted"}; written to data/curation.yaml`;
    });
  });
}

export async function runAgain() {
  await attempt(async () => {
    await change("run");
    document.dispatchEvent(new CustomEvent("run-started"));
  });
}

// Process clips again in all stages, from the recording on, although their results are cached.
export async function rerun(clips) {
  await attempt(async () => {
    const started = await change("rerun", { clips });
    tell(`re-run of ${started === 1 ? clips[0] : `${started} clips`} started`);
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
