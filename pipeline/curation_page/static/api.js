// Reads are plain GETs. A change is a POST with the token of the address that the terminal showed.

import { tell } from "./dom.js";

const KEY = "booster-lab-token";

// The address that the terminal showed may be opened where the page is open already: then only its fragment is new.
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (!given) return;
  localStorage.setItem(KEY, given);
  history.replaceState(null, "", "#/");
}
takeToken();
window.addEventListener("hashchange", takeToken);

async function answered(response) {
  if (response.ok) return response;
  let why = `${response.status} ${response.statusText}`;
  try { why = (await response.json()).error ?? why; } catch { /* not JSON: the status is all there is */ }
  throw new Error(why);
}

async function asked(path, options) {
  const response = await fetch(path, options).catch(() => {
    throw new Error("the server does not answer; start `booster-lab curate` again and open the address that it shows");
  });
  return answered(response);
}

export async function getJson(path) {
  return (await asked(path)).json();
}

export async function getBytes(path) {
  return (await asked(path)).arrayBuffer();
}

export async function change(name, value = {}) {
  const headers = { "Content-Type": "application/json", "X-Booster-Lab-Token": localStorage.getItem(KEY) ?? "" };
  return (await (await asked(`/api/${name}`, { method: "POST", headers, body: JSON.stringify(value) })).json()).done;
}

export async function attempt(work) {
  try {
    return await work();
  } catch (error) {
    tell(error.message, true);
    return undefined;
  }
}

const name = document.getElementById("name");
name.value = localStorage.getItem("booster-lab-name") ?? "";
name.addEventListener("change", () => localStorage.setItem("booster-lab-name", name.value.trim()));

// The name of the person, which every decision states; the field is shown where it is missing.
export function person() {
  const found = name.value.trim();
  if (!found) {
    name.focus();
    throw new Error("state your name at the top right: every decision is signed");
  }
  return found;
}
