// Shows the page that the fragment of the address names; reads the clip table once, and again after changes.

import { attempt, getJson } from "./api.js";
import { ClipPage } from "./clip_page.js";
import { ClipsPage } from "./clips_page.js";
import { DatabasesPage } from "./databases_page.js";
import { DecisionsPage } from "./decisions_page.js";
import { el } from "./dom.js";
import { ProposalsPage } from "./proposals_page.js";
import { RunState } from "./run_state.js";
import { ClipTable } from "./table.js";

const main = document.getElementById("main");
const places = new Map();  // address of a view of all clips -> its state when it was left, for the back button
let page = null;
let table = null;
let shown = 0;
let renewed = Promise.resolve();

async function clips() {
  table ??= new ClipTable(await getJson("/api/clips"));
  return table;
}

// `kept`: state of the page of all clips before the table was read again.
async function show(kept = places.get(location.hash)) {
  const mine = (shown += 1);
  const [path, query = ""] = location.hash.replace(/^#/, "").split("?");
  const [, name = "", ...rest] = path.split("/");
  const next = await attempt(() => makePage(name, rest.join("/"), new URLSearchParams(query), kept));
  if (mine !== shown || !next) return;
  if (page?.kept) places.set(page.address, page.kept(true));
  page?.leave();
  page = next;
  main.replaceChildren(...[next.element].flat());
  if (kept && next.attached) next.attached(kept);
  if (next.load) await attempt(() => next.load());
  for (const link of document.querySelectorAll("nav a[data-page]")) link.classList.toggle("here", link.dataset.page === (name || "clips"));
  document.body.dataset.shown = `${name || "clips"} ${mine}`;
}

async function makePage(name, rest, query, kept) {
  if (name === "clip") return new ClipPage(decodeURIComponent(rest));
  if (name === "databases") return new DatabasesPage();
  if (name === "proposals") return new ProposalsPage();
  if (name === "decisions") return new DecisionsPage();
  const found = await clips();
  if (!found.count) return { element: el("p", { class: "empty" }, `There are no clips yet. Run: dagster asset materialize --select ${found.database}`), leave() {} };
  return new ClipsPage(found, query, kept);
}

window.addEventListener("hashchange", () => show());
document.addEventListener("decisions-changed", () => again(false));
new RunState(() => again(true, true), () => again(true));
show();

// Update the page, one update after the other, so that a late response never shows outdated data.
function again(...what) {
  const next = () => renew(...what);
  renewed = renewed.then(next, next);
}

// Read the data again. Keeps filters, scroll position, playback, focus and, if `selected`, the selected clips.
async function renew(selected, motions = false) {
  table = null;
  const focused = main.contains(document.activeElement) ? document.activeElement : null;
  if (page?.load) await attempt(() => page.load(motions));
  else await show(page?.kept?.(selected));
  if (focused && !focused.isConnected && document.activeElement === document.body) sameControl(focused).focus({ preventScroll: true });
}

// The new control that corresponds to a replaced one; the page itself if there is none or more than one.
function sameControl(gone) {
  const name = (each) => `${each.className} ${each.name ?? ""} ${each.getAttribute("aria-label") ?? each.textContent}`;
  const found = [...main.querySelectorAll(gone.tagName)].filter((each) => !each.disabled && name(each) === name(gone));
  return found.length === 1 ? found[0] : main;
}
