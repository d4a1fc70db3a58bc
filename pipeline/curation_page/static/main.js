// Which page is shown, by the address's fragment; the table of clips is read once and again when it changed.

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
const places = new Map();  // address of a view of all clips -> what it had when it was left, for the way back
let page = null;
let table = null;
let shown = 0;
let renewed = Promise.resolve();

async function clips() {
  table ??= new ClipTable(await getJson("/api/clips"));
  return table;
}

// `kept`: what the page of all clips had before the table was read again.
async function show(kept = places.get(location.hash)) {
  const mine = (shown += 1);
  const [path, query = ""] = location.hash.replace(/^#/, "").split("?");
  const [, name = "", ...rest] = path.split("/");
  const next = await attempt(() => made(name, rest.join("/"), new URLSearchParams(query), kept));
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

async function made(name, rest, query, kept) {
  if (name === "clip") return new ClipPage(decodeURIComponent(rest));
  if (name === "databases") return new DatabasesPage();
  if (name === "proposals") return new ProposalsPage();
  if (name === "decisions") return new DecisionsPage();
  const found = await clips();
  if (!found.count) return { element: el("p", { class: "empty" }, `The graph has made no clips yet. Run: dagster asset materialize --select ${found.database}`), leave() {} };
  return new ClipsPage(found, query, kept);
}

window.addEventListener("hashchange", () => show());
document.addEventListener("decisions-changed", () => again(false));
new RunState(() => again(true, true), () => again(true));
show();

// Show what is there now, one time after the other: an older answer that comes late would show what was.
function again(...what) {
  const next = () => renew(...what);
  renewed = renewed.then(next, next);
}

// What a person was at stays: filters, place, playback, the focus and, if `selected`, the selected clips.
async function renew(selected, motions = false) {
  table = null;
  const focused = main.contains(document.activeElement) ? document.activeElement : null;
  if (page?.load) await attempt(() => page.load(motions));
  else await show(page?.kept?.(selected));
  if (focused && !focused.isConnected && document.activeElement === document.body) sameControl(focused).focus({ preventScroll: true });
}

// The control that has taken the place of another one; of one that is gone, or that several look like, the page itself.
function sameControl(gone) {
  const name = (each) => `${each.className} ${each.name ?? ""} ${each.getAttribute("aria-label") ?? each.textContent}`;
  const found = [...main.querySelectorAll(gone.tagName)].filter((each) => !each.disabled && name(each) === name(gone));
  return found.length === 1 ? found[0] : main;
}
