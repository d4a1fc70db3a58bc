// Requests to the server: GET reads; POST changes something and sends the token from the address in the terminal.

import { tell } from "./dom.js";

const KEY = "booster-lab-token";

// Store the token from the address. If the page is already open in this tab, only the fragment changes (hashchange).
function takeToken() {
  const given = new URLSearchParams(location.hash.slice(1)).get("token");
  if (!given) return;
  localStorage.setItem(KEY, given);
  history.replaceState(null, "", "#/");
}
takeToken();
window.addEventListener("hashchange", takeToken);

async function checked(response) {
  if (response.ok) return response;
  let why = `${response.status} ${response.statusText}`;
  try { why = (await response.json()).error ?? why; } catch { /* not JSON: report the status */ }
  throw new Error(why);
}

async function request(path, options) {
  const response = await fetch(path, options).catch(() => {
    throw new Error("the server does not answer; run `booster-lab curate` again and open the address that it prints");
  });
  return checked(response);
}

export async function getJson(path) {
  return (await request(path)).json();
}

export async function getBytes(path) {
  return (await request(path)).arrayBuffer();
}

export async function change(name, value = {}) {
  const headers = { "Content-Type": "application/json", "X-Booster-Lab-Token": localStorage.getItem(KEY) ?? "" };
  return (await (await request(`/api/${name}`, { method: "POST", headers, body: JSON.stringify(value) })).json()).done;
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

// Name of the person, which every decision contains. Focuses the field and throws if it is empty.
export function person() {
  const found = name.value.trim();
  if (!found) {
    name.focus();
    throw new Error("enter your name at the top right: every decision is recorded with a name");
  }
  return found;
}
