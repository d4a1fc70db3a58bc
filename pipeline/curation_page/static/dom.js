// Only this module creates elements. Strings are inserted as text nodes, so markup in names and reasons is never parsed.

export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name === "class") made.className = value;
    else if (name in made && name !== "list") made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

export function table(header, rows, numeric = []) {
  const kind = (place) => (numeric.includes(place) ? "number" : "wrap");
  return el("table", {},
    el("thead", {}, el("tr", {}, header.map((text, place) => el("th", { class: numeric.includes(place) ? "number" : "" }, text)))),
    el("tbody", {}, rows.map((row) => el("tr", {}, row.map((cell, place) => el("td", { class: kind(place) }, cell ?? ""))))));
}

// Format a number: integers with all digits, others with `digits` significant digits.
export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return String(Number.isInteger(value) ? value : Number(value.toPrecision(digits)));
}

export function seconds(value) {
  if (!Number.isFinite(value)) return "–";
  return `${Number(value).toFixed(Math.abs(value) < 100 ? 2 : 0)} s`;
}

export function clipLink(clip, text = clip) {
  return el("a", { href: `#/clip/${encodeURIComponent(clip)}` }, text);
}

const message = document.getElementById("message");
let hiding = 0;

export function tell(text, error = false) {
  clearTimeout(hiding);
  message.textContent = text;
  message.className = error ? "error" : "";
  message.hidden = false;
  hiding = setTimeout(() => { message.hidden = true; }, error ? 15000 : 6000);
}
