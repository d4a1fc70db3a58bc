// Decode line figures (pipeline/curation_page/line_figure.py) and draw them on a canvas.

const MISSING = -32768;
const CONTACT = "#2ca02c";

export function parse(buffer) {
  if (buffer.byteLength < 4) return [];
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  return head.figures.map((figure) => {
    const count = figure.frames * figure.lines * 6;
    const steps = new Int16Array(buffer, offset, count);
    offset += 2 * count;
    return { ...figure, steps, step: head.step_m, duration: Math.max(figure.frames - 1, 0) / figure.fps };
  });
}

export function frameAt(figure, time) {
  return Math.min(Math.max(Math.round(time * figure.fps), 0), figure.frames - 1);
}

// Horizontal centre of a figure in a frame [m]; null if all parts are missing.
export function middle(figure, frame) {
  const { steps, lines, step } = figure;
  let x = 0, y = 0, count = 0;
  for (let line = 0, at = frame * lines * 6; line < lines; line += 1, at += 6) {
    if (steps[at] === MISSING) continue;
    x += steps[at] + steps[at + 3];
    y += steps[at + 1] + steps[at + 4];
    count += 2;
  }
  return count ? [(x / count) * step, (y / count) * step] : null;
}

// Height of the highest point in the first frames [m].
export function height(figure) {
  let most = 0;
  for (let at = 2; at < Math.min(figure.steps.length, figure.lines * 60); at += 3) most = Math.max(most, figure.steps[at]);
  return Math.max(most * figure.step, 0.3);
}

export function inContact(figure, foot, time) {
  return foot >= 0 && figure.contacts !== null && figure.contacts[foot].some(([start, stop]) => start <= time && time < stop);
}

// `camera`: azimuth and elevation [rad], scale [pixels/m], and `focus`, the point [m] that appears at (x, y) [pixels].
export function draw(context, figure, frame, camera) {
  const { steps, lines, step } = figure;
  const [sa, ca, sp, cp] = [Math.sin(camera.azimuth), Math.cos(camera.azimuth), Math.sin(camera.elevation), Math.cos(camera.elevation)];
  const [fx, fy, fz] = camera.focus;
  const project = (at) => {
    const x = steps[at] * step - fx, y = steps[at + 1] * step - fy, z = steps[at + 2] * step - fz;
    const forward = -sa * x + ca * y;
    return [camera.x + camera.scale * (ca * x + sa * y), camera.y - camera.scale * (sp * forward + cp * z), cp * forward - sp * z];
  };
  const time = frame / figure.fps;
  const feet = [inContact(figure, 0, time), inContact(figure, 1, time)];
  const drawn = [];
  for (let line = 0, at = frame * lines * 6; line < lines; line += 1, at += 6) {
    if (steps[at] === MISSING) continue;
    const [from, to] = [project(at), project(at + 3)];
    drawn.push({ line, from, to, depth: (from[2] + to[2]) / 2 });
  }
  drawn.sort((one, two) => two.depth - one.depth);
  context.lineCap = "round";
  for (const { line, from, to } of drawn) {
    const foot = figure.foot[line];
    const width = 2 * figure.radius[line] * camera.scale;
    stroke(context, from, to, width + 1.5, "rgba(20, 24, 32, .55)");
    stroke(context, from, to, width, foot >= 0 && feet[foot] ? CONTACT : figure.color[line]);
  }
  return drawn.length > 0;
}

function stroke(context, from, to, width, color) {
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  context.moveTo(from[0], from[1]);
  context.lineTo(to[0] + 0.01, to[1]);
  context.stroke();
}

export function drawGround(context, camera, reach = 2.5, spacing = 0.5) {
  const [sa, ca, sp, cp] = [Math.sin(camera.azimuth), Math.cos(camera.azimuth), Math.sin(camera.elevation), Math.cos(camera.elevation)];
  const project = (x, y) => {
    const [dx, dy] = [x - camera.focus[0], y - camera.focus[1]];
    const forward = -sa * dx + ca * dy;
    return [camera.x + camera.scale * (ca * dx + sa * dy), camera.y - camera.scale * (sp * forward - cp * camera.focus[2])];
  };
  const first = (value) => Math.ceil((value - reach) / spacing) * spacing;
  context.strokeStyle = "#d5d8de";
  context.lineWidth = 1;
  context.beginPath();
  for (let x = first(camera.focus[0]); x <= camera.focus[0] + reach; x += spacing) {
    context.moveTo(...project(x, camera.focus[1] - reach));
    context.lineTo(...project(x, camera.focus[1] + reach));
  }
  for (let y = first(camera.focus[1]); y <= camera.focus[1] + reach; y += spacing) {
    context.moveTo(...project(camera.focus[0] - reach, y));
    context.lineTo(...project(camera.focus[0] + reach, y));
  }
  context.stroke();
}

// Azimuth of a view from the front right of the figure at its first heading [rad].
export function frontRight(figure) {
  return figure.heading + (40 * Math.PI) / 180;
}
