"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const get = (id) => document.getElementById(id);
const events = data.events;
const sub = (a, b) => `${a}<tspan dy="3" font-size="10">${b}</tspan><tspan dy="-3">\u200b</tspan>`;
const range = (n) => Array.from({ length: n }, (_, i) => i);
const onPage = (colour) => `color-mix(in srgb, ${colour}, white var(--lift))`; // lighter on a dark page
const ink = "currentColor", grey = "var(--grey)";
let chosen = -1;

// --- axes ---------------------------------------------------------------------------------------

function ticks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((one) => one * power >= rough * 0.999);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return range(last - first + 1).map((i) => [(first + i) * step, ((first + i) * step).toFixed(places)]);
}

class Panel {
  constructor(left, top, width, height, x, y) {
    Object.assign(this, { left, top, width, height, x, y });
  }
  px(x) { return +(this.left + ((x - this.x[0]) / (this.x[1] - this.x[0])) * this.width).toFixed(2); }
  py(y) { return +(this.top + (1 - (y - this.y[0]) / (this.y[1] - this.y[0])) * this.height).toFixed(2); }
  axes(xLabel, yLabel) {
    const { left, top, width, height } = this, bottom = top + height, parts = [];
    for (const [value, text] of ticks(...this.x, 8)) {
      const x = this.px(value);
      parts.push(`<path class="tick" d="M${x} ${bottom}v-5"/>`);
      if (xLabel) parts.push(`<text x="${x}" y="${bottom + 16}" text-anchor="middle">${text}</text>`);
    }
    for (const [value, text] of ticks(...this.y, 5)) {
      const y = this.py(value);
      parts.push(`<path class="tick" d="M${left} ${y}h5"/>`);
      parts.push(`<text x="${left - 7}" y="${y + 4}" text-anchor="end">${text}</text>`);
    }
    parts.push(`<rect class="frame" x="${left}" y="${top}" width="${width}" height="${height}"/>`);
    const middle = `${left - 48} ${top + height / 2}`;
    parts.push(`<text transform="translate(${middle}) rotate(-90)" text-anchor="middle">${yLabel}</text>`);
    if (xLabel) parts.push(`<text x="${left + width / 2}" y="${bottom + 35}" text-anchor="middle">${xLabel}</text>`);
    return parts.join("");
  }
  line(xs, ys, colour, kind = "") {
    let path = "", pen = "M";
    for (const i of range(ys.length)) {
      if (ys[i] === null) { pen = "M"; continue; }
      path += `${pen}${this.px(xs[i])} ${this.py(ys[i])}`;
      pen = "L";
    }
    return `<path class="line ${kind}" stroke="${colour}" d="${path}"/>`;
  }
  level(y, name, x = this.x[1]) {
    const at = this.py(y);
    return `<path class="line dotted" stroke="${grey}" d="M${this.left} ${at}h${this.width}"/>` +
      `<text x="${this.px(x) - 4}" y="${at - 4}" text-anchor="end" fill="${grey}">${name}</text>`;
  }
}

// --- loading curve and slip map -----------------------------------------------------------------

const times = data.curve.t, begin = times[0], end = Math.max(times[times.length - 1], begin + 1e-9);
const highest = 1.12 * Math.max(data.mu_k, ...data.curve.F);
const loading = new Panel(62, 10, 825, 205, [begin, end], [0, highest]);
const map = new Panel(62, 230, 825, 190, [begin, end], [0, 1]);

function drawGrowth() {
  const panel = new Panel(62, 10, 825, 410, [0, 1.05 * Math.max(...data.curve.F, 1e-9)], [0, 1]);
  get("map").innerHTML = panel.line(data.curve.F, data.growth, ink) +
    panel.axes(`force ${sub("F", "T")}/${sub("F", "N")}`, `slipping zone ${sub("L", "p")}/L`);
}

function drawOverview() {
  if (data.growth) return drawGrowth();
  const parts = [loading.level(data.mu_k, sub("μ", "k"), begin + 0.03 * (end - begin)), loading.line(data.curve.t, data.curve.F, ink)];
  for (const kind of ["micro", "partial", "whole"]) {
    const paths = { 1: "", 0: "" };
    if (data.slip[kind]) data.slip[kind][0].forEach((t, i) => {
      const [, from, to, slipped] = data.slip[kind];
      paths[slipped[i]] += `M${map.px(t)} ${map.py(from[i])}V${map.py(to[i])}`;
    });
    const wide = kind === "micro" ? 1 : 2;
    parts.push(`<path stroke="${onPage(data.colours[kind])}" stroke-width="${wide}" d="${paths[1]}"/>`);
    parts.push(`<path stroke="${onPage(data.colours[kind])}" stroke-width="${wide / 3}" d="${paths[0]}"/>`);
  }
  parts.push(loading.axes("", `force ${sub("F", "T")}/${sub("F", "N")}`));
  parts.push(map.axes("time t (s)", "slip region x/L"));
  get("map").innerHTML = parts.join("") + '<path id="marker" class="marker" d=""/>';
}

// --- one event ----------------------------------------------------------------------------------

const shown = (value, digits, unit = "") => (value === null ? "not known" : value.toPrecision(digits) + unit);

function words(one) {
  const kind = { whole: "slip over the whole interface", partial: "partial slip", micro: "micro-slip" }[one.kind];
  return `Event ${one.event}: ${kind}, first slip at ${one.t.toFixed(6)} s, ${one.blocks} of ${data.N_x} blocks, ` +
    `L_p/L = ${shown(one.L_p, 3)}, F_T/F_N ${shown(one.start, 4)} before and ${shown(one.arrest, 4)} after, ` +
    `duration ${one.duration === null ? "not known" : (one.duration * 1e3).toPrecision(4) + " ms"}, ` +
    `starts at x/L = ${shown(one.x_0, 3)}.`;
}

const nothing = (text) => `<text x="450" y="200" text-anchor="middle">${text}</text>`;

function shade(share) {
  return `color-mix(in srgb, var(--least), var(--most) ${(100 * share).toFixed(1)}%)`;
}

function drawSlips(detail) {
  const slips = detail.slips.filter((one) => one[1] !== null);
  const ends = slips.map((one) => one[2] ?? one[1]);
  if (!slips.length || !(Math.max(...ends) > 0)) return nothing("This engine knows no motion inside this event.");
  const first = new Map();
  for (const [n, t] of slips) if (!(first.get(n) <= t)) first.set(n, t);
  const low = Math.min(0, ...slips.map((one) => one[1]));
  const front = Math.max(...first.values());
  const high = get("zoom").checked && front > low ? low + 1.1 * (front - low) : Math.max(...ends);
  const scale = high - low > 2000 ? 1e-3 : 1;
  const panel = new Panel(62, 10, 760, 370, [0, 1], [low * scale, high * scale]);
  const most = Math.max(...slips.map((one) => Math.abs(one[3] ?? 0)), 1e-9), parts = [];
  for (const [n, t, stop, slip] of slips) {
    if (t > high) continue;
    const x = panel.px((n - 1) / data.N_x), wide = Math.max(panel.width / data.N_x - 0.3, 0.4);
    const y = panel.py(Math.min(stop ?? high, high) * scale), tall = Math.max(panel.py(t * scale) - y, 0.8);
    parts.push(`<rect x="${x}" y="${y}" width="${wide.toFixed(2)}" height="${tall.toFixed(2)}" fill="${shade(Math.sqrt(Math.abs(slip ?? 0) / most))}"/>`);
  }
  for (const [n, t] of first) if (t <= high) parts.push(`<circle cx="${panel.px((n - 0.5) / data.N_x)}" cy="${panel.py(t * scale)}" r="1.8"/>`);
  parts.push(panel.axes("position x/L from the trailing edge", `time from the first slip (${scale === 1 ? "μs" : "ms"})`));
  return parts.join("") + bar(most);
}

function bar(most) {
  const parts = range(50).map((i) => `<rect x="840" y="${376 - 7.4 * i}" width="14" height="7.6" fill="${shade(Math.sqrt((i + 0.5) / 50))}"/>`);
  const micro = most >= 1000, scale = micro ? 1e-3 : 1;
  const panel = new Panel(840, 10, 14, 374, [0, 1], [0, most * scale]);
  for (const [value, text] of ticks(0, most * scale, 5))
    parts.push(`<text x="858" y="${panel.py(value) + 4}">${text}</text>`);
  parts.push(`<text x="897" y="415" text-anchor="end">slip (${micro ? "μm" : "nm"})</text>`);
  return parts.join("");
}

function legend([name, colour, kind], i) {
  const x = 62 + [0, 100, 190, 390][i];
  return `<path class="line ${kind}" stroke="${colour}" d="M${x} 16h28"/><text x="${x + 34}" y="20">${name}</text>`;
}

function drawStresses(detail) {
  const x = range(data.N_x).map((i) => i / Math.max(data.N_x - 1, 1));
  const blue = onPage("#0072B2"), red = onPage("#D55E00");
  const all = ["tau_before", "tau_after", "p_before", "p_after"].flatMap((name) => detail[name]).filter((v) => v !== null);
  if (!all.length) return nothing("The record holds no static state of this event.");
  const ratio = (when) => detail[`tau_${when}`].map((tau, i) => (tau === null || !(detail[`p_${when}`][i] > 0) ? null : tau / detail[`p_${when}`][i]));
  const before = ratio("before"), after = ratio("after");
  const known = [...before, ...after].filter((v) => v !== null);
  const upper = new Panel(62, 34, 825, 240, [0, 1], [Math.min(0, ...all), 1.05 * Math.max(...all)]);
  const lower = new Panel(62, 299, 825, 200, [0, 1], [Math.min(0, ...known), 1.15 * Math.max(data.mu_s, ...known)]);
  return [
    ...[["before", blue, ""], ["after", red, ""], ["friction force τ, τ/p", ink, ""], ["normal force p", ink, "dashed"]].map(legend),
    upper.line(x, detail.p_before, blue, "dashed"), upper.line(x, detail.p_after, red, "dashed"),
    upper.line(x, detail.tau_before, blue), upper.line(x, detail.tau_after, red),
    upper.axes("", `τ and p over ${sub("F", "N")}/${sub("N", "x")}`),
    lower.level(data.mu_s, sub("μ", "s")), lower.level(data.mu_k, sub("μ", "k")),
    lower.line(x, before, blue), lower.line(x, after, red),
    lower.axes("position x/L from the trailing edge", "τ/p"),
  ].join("");
}

function drawEvent() {
  const detail = data.details[events[chosen].event];
  const missing = nothing("The page holds no drawings of this event: it would be larger than 2 MB.");
  get("xt").innerHTML = detail ? drawSlips(detail) : missing;
  get("stress").innerHTML = detail ? drawStresses(detail) : missing;
  const known = (value) => (value === null ? "not known" : value);
  document.querySelectorAll("#columns .value").forEach((cell, i) => { cell.textContent = detail ? known(detail.columns[i]) : ""; });
}

function choose(index) {
  if (!events.length) return;
  chosen = Math.min(Math.max(index, 0), events.length - 1);
  const one = events[chosen], text = words(one);
  get("event-title").textContent = `Event ${one.event}`;
  get("said").innerHTML = text.replace(/(\w)_(\w)/g, "$1<sub>$2</sub>");
  get("choice").value = chosen;
  get("previous").disabled = chosen === 0;
  get("next").disabled = chosen === events.length - 1;
  const x = map.px(one.t);
  get("marker").setAttribute("d", `M${x} ${loading.top}V${map.top + map.height}`);
  get("map").setAttribute("aria-valuenow", chosen);
  get("map").setAttribute("aria-valuetext", text.replaceAll("_", ""));
  document.querySelectorAll("tr[aria-current]").forEach((row) => row.removeAttribute("aria-current"));
  get("table").tBodies[0].rows[chosen].setAttribute("aria-current", "true");
  drawEvent();
}

// --- mouse and keys -----------------------------------------------------------------------------

function nearest(click) {
  const box = get("map").getBoundingClientRect();
  const at = ((click.clientX - box.left) / box.width) * 900;
  const far = (one) => Math.abs(map.px(one.t) - at) + (one.kind === "micro" ? 4 : 0); // main events are easier to hit
  return events.reduce((best, one, i) => (far(one) < far(events[best]) ? i : best), 0);
}

function mainFrom(index, step) {
  for (let i = index + step; events[i]; i += step) if (events[i].kind !== "micro") return i;
  return index;
}

const MOVES = {
  ArrowRight: (i) => i + 1, ArrowUp: (i) => i + 1, ArrowLeft: (i) => i - 1, ArrowDown: (i) => i - 1,
  PageDown: (i) => mainFrom(i, 1), PageUp: (i) => mainFrom(i, -1), Home: () => 0, End: () => events.length - 1,
};

function asked() {
  const found = /^#event-(\d+)$/.exec(location.hash);
  const index = found ? events.findIndex((one) => one.event === +found[1]) : -1;
  if (index < 0) return false;
  choose(index);
  get("event-title").focus();
  return true;
}

drawOverview();
get("table").classList.toggle("hide-micro", events.some((one) => one.kind !== "micro"));
get("micro").checked = !get("table").classList.contains("hide-micro");
get("micro").addEventListener("change", (e) => get("table").classList.toggle("hide-micro", !e.target.checked));
get("zoom").addEventListener("change", () => chosen >= 0 && drawEvent());
get("previous").addEventListener("click", () => choose(chosen - 1));
get("next").addEventListener("click", () => choose(chosen + 1));
get("choice").addEventListener("change", (e) => choose(+e.target.value));
get("map").addEventListener("click", (e) => events.length && choose(nearest(e)));
get("map").addEventListener("keydown", (e) => {
  if (!MOVES[e.key] || e.ctrlKey || e.altKey || e.metaKey) return;
  e.preventDefault();
  choose(MOVES[e.key](chosen));
});
window.addEventListener("hashchange", asked);
const rank = (one) => one.blocks + (one.precursor ? data.N_x : 0); // the largest precursor, else the largest event
if (!asked()) choose(events.reduce((best, one, i) => (rank(one) > rank(events[best]) ? i : best), 0));
