"use strict";
// Parts of the page around the plane: made once, or when another plan is picked. They read the
// `state` of player.js, and change it by its functions.

const MOST_NAMES = 14; // of trims in the legend
const MOST_ROWS = 20; // of vehicles on the bar
const SEEN = 0.005; // of the time: a trim that takes less can hardly be seen
const KEYS = [
  ["space", "play or pause"],
  ["← →", "back or on by a fiftieth of the time; with shift, a tenth of that"],
  ["[ ]", "to where the trim begins, or the next one"],
  ["home end", "to the begin or the end"],
  ["+ − f", "closer, farther, show all; or wheel, drag, pinch, double click"],
  ["s S", "faster, slower"],
  ["1 … 9", "the plan, and its alternatives"],
  ["b w p", "bodies, swept region, path"],
  ["d", "dark or light"],
  ["?", "these keys"],
];

const FLEET_KEYS = [
  ["1 … 9", "a vehicle; or click it"],
  ["Esc", "all vehicles; or click where there is none"],
];

/** Black or white, whichever reads better on a colour "#rrggbb". */
function inkOn(color) {
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  return 0.299 * r + 0.587 * g + 0.114 * b > 130 ? "#000000" : "#ffffff";
}

function element(kind, className, text = "") {
  const made = document.createElement(kind);
  if (className) made.className = className;
  made.textContent = text;
  return made;
}

function buildHead() {
  find("title").textContent = data.title;
  if (data.back) { // to the page that leads here
    const { href, text } = data.back;
    Object.assign(find("back"), { href, textContent: `← ${text}`, hidden: false });
  }
  for (const [name, value] of data.facts) {
    const pair = element("div");
    pair.append(element("dt", "", name), element("dd", "", value));
    find("facts").append(pair);
  }
}

function buildBar() {
  const bar = find("bar"), now = motion(), { begin, end } = span();
  bar.replaceChildren();
  bar.setAttribute("aria-valuemin", begin);
  bar.setAttribute("aria-valuemax", end);
  const wide = bar.getBoundingClientRect().width, length = end - begin || 1;
  const first = element("div", "before");
  first.style.width = `${(100 * (now.begin - begin)) / length}%`;
  bar.append(...(now.runs.length ? [first] : fleetRows()));
  for (const run of now.runs) {
    const { name, color } = data.trims[run.trim];
    const share = (run.end - run.begin) / length;
    const fits = share * wide > 16 + 7 * Math.min(name.length, 9);
    const part = element("div", "trim", fits ? name : "");
    part.style.width = `${100 * share}%`;
    if (!fits) part.style.padding = "0";
    part.style.background = color;
    part.style.color = inkOn(color);
    bar.append(part);
  }
  bar.append(element("div", "past"), element("div", "hover"), element("div", "now"));
  for (const entry of steps ? steps.entries : (fleet && fleet.steps) || []) {
    const other = entry.replanned || (entry.swaps || []).length > 0;
    if (!other && !entry.broken.length) continue;
    const mark = element("div", entry.broken.length ? "mark broken" : "mark");
    mark.style.left = `${(100 * (entry.t - begin)) / length}%`;
    bar.append(mark);
  }
  find("legend").replaceChildren(...(manyTrims() ? [] : trimsShown().map(legendItem)));
  find("limits").replaceChildren(...limitItems());
}

/** While no vehicle is picked, the time of each as a row of the bar. */
function fleetRows() {
  if (!fleet || motions.length > MOST_ROWS) return [];
  const length = fleet.end - fleet.begin || 1, high = 100 / motions.length;
  return motions.filter((one) => one.runs.length).map((one) => {
    const row = element("div", "row"), { style } = row;
    style.left = `${(100 * (one.begin - fleet.begin)) / length}%`;
    style.width = `${(100 * (one.end - one.begin)) / length}%`;
    style.top = `${high * (motions.indexOf(one) + 0.1)}%`;
    style.height = `${0.8 * high}%`;
    style.background = one.color;
    return row;
  });
}

/** A button for each vehicle of a fleet, which picks it. */
function buildVehicles() {
  if (!fleet) return;
  find("vehicles").hidden = false;
  motions.forEach((one, k) => {
    const button = element("button", one.runs.length || !one.reason ? "" : "none");
    const swatch = element("i");
    swatch.style.background = one.color;
    button.type = "button";
    button.title = one.reason ? `${one.name}: ${one.reason}` : one.name;
    button.setAttribute("aria-pressed", "false");
    const text = one.label === one.name ? one.name : `${one.label} · ${one.name}`;
    button.append(swatch, element("span", "", text));
    button.addEventListener("click", () => pick(k === state.choice ? -1 : k));
    find("vehicles").append(button);
  });
}

/** Trims of the motion that is shown, in order, but those that take next to no time. */
function trimsShown() {
  const now = motion(), lasted = new Map();
  now.runs.forEach(({ trim, begin, end }) =>
    lasted.set(trim, (lasted.get(trim) || 0) + end - begin));
  return [...lasted.keys()].filter((trim) => lasted.get(trim) >= SEEN * (now.end - now.begin));
}

/** What zones ask for, and the bounds, as items of a legend. */
function limitItems() {
  const names = new Set((data.zones || []).map((zone) => zone.name));
  const items = [...names].map((name) => [name, "zone"]);
  if ((data.bounds || []).length) items.push(["bounds of the pose", "bounds"]);
  return items.map(([name, kind]) => {
    const item = element("li");
    item.append(element("i", kind), element("span", "", name));
    return item;
  });
}

/** Whether the legend names only the trim under way. */
const manyTrims = () => trimsShown().length > MOST_NAMES;

function legendItem(trim) {
  const item = element("li"), swatch = element("i"), { name, color } = data.trims[trim];
  item.dataset.trim = String(trim);
  item.title = name;
  swatch.style.background = color;
  item.append(swatch, element("span", "", name));
  return item;
}

/** Quantities over the time of the motion that is shown: clearance, speed, controls, altitude. */
function quantities() {
  const now = motion(), list = [];
  const curve = (label, { t, v }) => ({
    label, points: t.map((at, k) => [at, v[k]]),
    value: (time) => (!fleet || now.drivesAt(time) ? curveAt({ t, v }, time) : NaN),
  });
  if (now.clearance) list.push(curve("clearance [m]", now.clearance));
  const others = now === overview ? fleet.distance : now.others;
  if (others) {
    const label = now === overview ? "nearest two [m]" : "nearest other [m]";
    list.push({ ...curve(label, others), value: (time) => curveAt(others, time), level: fleet.margin });
  }
  if (now === overview && fleet.value) {
    const value = (time) => curveAt(fleet.value, time);
    list.push({ ...curve("value of all", fleet.value), value });
  }
  if (now === overview) return list;
  if (!now.curves.some((one) => /^speed\b/.test(one.label))) {
    const points = now.twists.flatMap((_, k) =>
      [now.times[k], now.times[k + 1]].map((at) => [at, now.speedAt(now.times[k])]));
    list.push({ label: "speed [m/s]", value: (time) => now.speedAt(time), points });
  }
  list.push(...now.curves.map((one) => curve(one.label, one)));
  if (now.poses[0].length > 3) {
    const points = now.strokes.flatMap((one) => one.times.map((at, n) => [at, one.poses[n][3]]));
    list.splice(1, 0, { label: "altitude [m]", value: (time) => now.poseAt(time)[3], points });
  }
  return list;
}

function buildCharts() {
  const parent = find("charts");
  parent.replaceChildren();
  const list = motion().runs.length || motion() === overview ? quantities() : [];
  charts = list.map((one, k) => new Chart(parent, { ...one, last: k === list.length - 1 }));
  parent.hidden = !charts.length;
  for (const chart of charts) {
    scrubbed(chart.canvas, (event) =>
      chart.timeAt(event.clientX - chart.canvas.getBoundingClientRect().left));
  }
}

/** Have a drag along an element set the time, and the pointer over it read values. */
function scrubbed(target, timeOf) {
  let held = false;
  target.addEventListener("pointerdown", (event) => {
    held = true;
    target.setPointerCapture(event.pointerId);
    play(false);
    seek(timeOf(event));
  });
  target.addEventListener("pointermove", (event) => {
    if (held) seek(timeOf(event));
    hoverAt(timeOf(event), event);
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    target.addEventListener(kind, () => { held = false; });
  }
  target.addEventListener("pointerleave", () => hoverAt(null));
}

function buildLayers() {
  const labels = {
    swept: "swept region", bodies: "bodies at switches", path: "path",
    others: fleet ? "other paths" : "alternatives", search: "search",
  };
  const moves = motions.some((one) => one.runs.length > 0);
  const swept = moves && (data.bodies.length > 0 || motions.some((one) => (one.bodies || []).length));
  const known = {
    swept, bodies: swept, path: moves,
    others: motions.length > 1,
    search: ["nodes", "reached", "narrowest"].some((one) => data.search && data.search[one]),
  };
  if (known.search) state.layers.search = true;
  for (const name of Object.keys(labels).filter((one) => known[one])) {
    const label = element("label"), box = element("input");
    box.type = "checkbox";
    box.dataset.layer = name;
    box.checked = state.layers[name];
    box.addEventListener("change", () => {
      state.layers[name] = box.checked;
      redraw();
    });
    label.append(box, labels[name]);
    find("layers").append(label);
  }
}

function toggleLayer(name) {
  const box = document.querySelector(`#layers input[data-layer="${name}"]`);
  if (box) box.click();
}

/** A small picture of every plan, the best first, all at the same time. */
function buildAlternatives() {
  if (motions.length < 2 || fleet) return;
  const figure = find("alternatives"), cards = figure.querySelector(".cards");
  figure.hidden = false;
  figure.querySelector("figcaption").textContent =
    `The plan and ${motions.length > 2 ? `${motions.length - 1} alternatives` : "an alternative"}, `
    + "each at the time of the bar";
  motions.forEach((one, k) => {
    const card = element("button", "card"), canvas = element("canvas");
    card.type = "button";
    card.setAttribute("aria-pressed", String(k === 0));
    const words = one.runs.map((run) => data.trims[run.trim].name);
    card.title = words.join(" → ");
    card.append(canvas, element("b", "", `${k + 1}. cost ${shownNumber(one.cost, 5)}`),
      element("small", "", `${shownNumber(one.end - one.begin)} s · ${words.join(" → ")}`));
    card.addEventListener("click", () => pick(k));
    cards.append(card);
    const small = new Stage(canvas, data);
    small.view.margins = { left: 0, right: 0, top: 0, bottom: 0 };
    small.axes = () => {};
    const layers = { path: true, bodies: false };
    const rest = { layers, hover: null, others: [], steps: null };
    minis.push((colors, time, stamp) =>
      small.draw(one, Math.min(time, one.end), { ...rest, colors, stamp }));
  });
}

function buildSearch() {
  const search = data.search;
  if (!search || search.cost === null || !(search.costs.length || search.bounds.length)) return;
  const figure = find("search"), canvas = figure.querySelector("canvas");
  figure.hidden = false;
  searchChart = new SearchChart(canvas, search);
  const caption = figure.querySelector("figcaption");
  const cost = element("span", "", "best cost"), bound = element("span", "", "lower bound");
  cost.style.color = "var(--accent)";
  bound.style.color = "var(--bound)";
  const many = search.costs.length;
  caption.append(`${many} ${many === 1 ? "plan" : "plans, each better"} · `, cost);
  if (searchChart.bounds.length) {
    caption.append(" · ", bound, search.kind ? ` (${search.kind})` : "");
  }
  canvas.addEventListener("pointermove", (event) => {
    searchHover = event.clientX - canvas.getBoundingClientRect().left;
    const { time, cost: price, bound: least } = searchChart.readAt(searchHover);
    const rows = [["search time", `${shownNumber(time, 3)} s`], ["cost", shownNumber(price, 6)]];
    if (least !== null) rows.push(["proven", `at least ${shownNumber(least, 6)}`]);
    showTip(rows, event);
    redraw();
  });
  canvas.addEventListener("pointerleave", () => {
    searchHover = null;
    showTip(null);
    redraw();
  });
}

/** What keys do; those of a fleet stand for those of a plan. */
function keysOfPage() {
  if (!fleet) return KEYS;
  return [...KEYS.filter(([keys]) => FLEET_KEYS.every(([others]) => others !== keys)), ...FLEET_KEYS];
}

function buildKeys() {
  const table = document.createElement("table");
  for (const [keys, what] of keysOfPage()) {
    const row = table.insertRow(), cell = row.insertCell();
    keys.split(" ").forEach((key) => cell.append(element("kbd", "", key), " "));
    row.insertCell().textContent = what;
  }
  find("keys").append(table);
  find("keys").addEventListener("click", () => find("keys").close());
}
