"use strict";
// The page: its time, what is shown, and what keys and pointers do.

const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16];
const LONGEST_FILM = 30; // s, longer motions start at a higher rate

const data = JSON.parse(document.getElementById("data").textContent);
const find = (name) => document.getElementById(name);
const motions = data.motions.map((entry) => new Motion(entry));
const fleet = data.fleet || null; // several vehicles at once, of which one may be picked
const overview = fleet && new Motion({
  times: [fleet.begin, fleet.end], poses: [[0, 0, 0]], twists: [], trims: [], bodies: [], goals: [],
});
const dark = window.matchMedia("(prefers-color-scheme: dark)");

const state = {
  time: (fleet || motions[0]).begin, hover: null, choice: fleet ? -1 : 0, playing: false, rate: 1, theme: null,
  layers: { path: true, swept: true, bodies: true, search: false, others: Boolean(fleet) },
};
const stage = new Stage(find("stage"), data);
const space = !fleet && motions[0].poses[0].length > 3 ? new Space(find("space"), data) : null;
const steps = data.steps && data.steps.length ? loopSteps(data.steps) : null;
let charts = [], minis = [], searchChart = null, searchHover = null, waiting = false;

const motion = () => motions[state.choice] || overview;
const span = () => fleet || motion(); // begin and end of the time that is shown

/** Steps of a closed loop as motions, and which is under way. */
function loopSteps(entries) {
  const times = entries.map((one) => one.t);
  return {
    entries,
    plans: entries.map((one) => new Motion(one.plan)),
    at: (time) => Math.max(0, lastNotAfter(times, time)),
  };
}

/** Names, values and units of everything known at a time. */
function valuesAt(time) {
  const now = motion(), pose = now.poseAt(time), { origin } = data;
  const run = now.runs.length ? now.runAt(time) : null;
  const rows = [["time", `${shownNumber(time)} s`]];
  if (fleet && now !== overview) rows.unshift(["vehicle", now.name]);
  const others = now === overview ? fleet.distance : now.others;
  if (others) {
    const label = now === overview ? "nearest two" : "nearest other";
    rows.push([label, `${shownNumber(curveAt(others, time), 3)} m`]);
  }
  if (now === overview) return rows;
  if (fleet && !now.drivesAt(time)) {
    const done = time > now.end ? now.reason || "arrived" : "has not left";
    rows.push(["state", now.runs.length ? done : now.reason]);
    return rows;
  }
  if (run) rows.push(["trim", data.trims[run.trim].name]);
  if (!now.curves.some((curve) => /^speed\b/.test(curve.label))) {
    rows.push(["speed", `${shownNumber(now.speedAt(time), 3)} m/s`]);
  }
  for (const curve of now.curves) {
    const [, name, unit = ""] = curve.label.match(/^(.*?)(?: \[(.*)\])?$/);
    rows.push([name, `${shownNumber(curveAt(curve, time), 3)} ${unit}`.trim()]);
  }
  if (now.clearance) {
    rows.push(["clearance", `${shownNumber(curveAt(now.clearance, time), 3)} m`]);
  }
  rows.push(["x, y", `${shownNumber(pose[0] + origin[0])}, ${shownNumber(pose[1] + origin[1])} m`]);
  if (pose.length > 3) rows.push(["altitude", `${shownNumber(pose[3])} m`]);
  rows.push(["heading", `${shownNumber((pose[2] * 180) / Math.PI, 3)}°`]);
  return rows;
}

function redraw() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    drawAll();
  });
}

function drawAll() {
  const colors = themeColors(), { time, hover } = state;
  const others = motions.filter((_, k) => k !== state.choice);
  const stamp = `${state.choice} ${document.documentElement.dataset.theme}`;
  const seen = `${stamp} ${Object.values(state.layers)}`;
  stage.draw(motion(), time, {
    colors, layers: state.layers, hover, others, steps, fleet, stamp: seen,
  });
  if (space) space.draw(motion(), time, { colors, hover, stamp });
  charts.forEach((chart) => chart.draw(motion(), span(), time, hover, colors, data.trims, stamp));
  minis.forEach((mini) => mini(colors, time, stamp));
  if (searchChart) searchChart.draw(colors, searchHover);
  drawBar();
  drawClock();
}

function drawBar() {
  const bar = find("bar"), { begin, end } = span();
  const share = (time) => `${(100 * (time - begin)) / (end - begin || 1)}%`;
  bar.querySelector(".now").style.left = share(state.time);
  bar.querySelector(".past").style.width = share(state.time);
  const hover = bar.querySelector(".hover");
  hover.hidden = state.hover === null;
  if (state.hover !== null) hover.style.left = share(state.hover);
  bar.setAttribute("aria-valuenow", state.time.toFixed(3));
  bar.setAttribute("aria-valuetext", `${state.time.toFixed(2)} s`);
  const run = motion().runs.length ? motion().runAt(state.time) : null;
  if (run && manyTrims()) {
    find("legend").replaceChildren(legendItem(run.trim));
  }
  find("legend").querySelectorAll("li").forEach((item) =>
    item.classList.toggle("current", Boolean(run) && Number(item.dataset.trim) === run.trim));
}

function drawClock() {
  find("clock").hidden = !motions.some((one) => one.runs.length);
  const parts = [`${state.time.toFixed(2)} s`];
  if (fleet) {
    const done = motions.filter((one) =>
      one.runs.length && !one.reason && state.time >= one.end - 1e-6).length;
    parts.push(`${done} of ${motions.length} arrived`);
    if (fleet.steps && state.time < fleet.end) parts.push(...fleetStep(state.time));
  } else if (steps) {
    const entry = steps.entries[steps.at(state.time)];
    if (state.time >= motion().end) parts.push(data.ending);
    else {
      parts.push(`step ${steps.at(state.time)}`, `value ${shownNumber(entry.value)}`);
      if (entry.replanned) parts.push("replanned");
      if (entry.broken.length) parts.push("guarantee broken");
    }
  } else if (state.time >= motion().end && data.ending) parts.push(data.ending);
  find("clock").textContent = parts.join(" · ");
}

/** What a fleet's closed loop does at a time, in words. */
function fleetStep(time) {
  const k = Math.max(0, lastNotAfter(fleet.steps.map((one) => one.t), time));
  const { swaps, broken } = fleet.steps[k], parts = [`step ${k}`];
  parts.push(`value ${shownNumber(curveAt(fleet.value, time))}`);
  if (swaps.length) parts.push(`exchanged: ${swaps.join(", ")}`);
  if (broken.length) parts.push("guarantee broken");
  return parts;
}

function seek(time) {
  state.time = Math.min(Math.max(time, span().begin), span().end);
  redraw();
}

function play(on) {
  if (on && state.time >= span().end) state.time = span().begin;
  state.playing = on && span().end > span().begin;
  find("play").textContent = state.playing ? "❚❚" : "▶";
  find("play").setAttribute("aria-pressed", String(state.playing));
  let before = null;
  const advance = (now) => {
    if (!state.playing) return;
    if (before !== null) seek(state.time + (state.rate * (now - before)) / 1000);
    before = now;
    if (state.time >= span().end) play(false);
    else requestAnimationFrame(advance);
  };
  if (state.playing) requestAnimationFrame(advance);
}

function setRate(rate) {
  state.rate = rate;
  find("rate").value = String(rate);
}

function pick(choice) {
  if (choice < (fleet ? -1 : 0) || choice >= motions.length) return;
  state.choice = choice;
  state.hover = null;
  seek(state.time);
  buildBar();
  buildCharts();
  document.querySelectorAll(".card, #vehicles button").forEach((card, k) =>
    card.setAttribute("aria-pressed", String(k === choice)));
  redraw();
}

function setTheme(theme) {
  state.theme = theme;
  document.documentElement.dataset.theme = theme || (dark.matches ? "dark" : "light");
  redraw();
}

/** Show what is known at a time beside the pointer. */
function hoverAt(time, event) {
  state.hover = time;
  showTip(time === null ? null : valuesAt(time), event);
  redraw();
}

function showTip(rows, event) {
  const tip = find("tip");
  tip.hidden = rows === null;
  if (rows === null) return;
  const table = document.createElement("table");
  for (const [name, value] of rows) {
    const row = table.insertRow();
    row.insertCell().textContent = name;
    const cell = row.insertCell();
    cell.textContent = value.length > 26 ? `${value.slice(0, 25)}…` : value;
  }
  tip.replaceChildren(table);
  const { width, height } = tip.getBoundingClientRect();
  const left = event.clientX + 16 + width > innerWidth ? event.clientX - 16 - width : event.clientX + 16;
  const top = Math.min(event.clientY + 14, innerHeight - height - 6);
  tip.style.left = `${Math.max(4, left)}px`;
  tip.style.top = `${Math.max(4, top)}px`;
}

function showKeys() {
  if (find("keys").open) find("keys").close();
  else find("keys").showModal();
}

function jump(forwards) {
  const now = motion(), arrivals = motions.map((one) => one.end).sort((a, b) => a - b);
  const times = now === overview ? arrivals : [...now.runs.map((run) => run.begin), now.end];
  const slack = 1e-6;
  const ahead = times.find((at) => at > state.time + slack);
  const back = times.filter((at) => at < state.time - slack).pop();
  seek((forwards ? ahead : back) ?? state.time);
}

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  const step = ((span().end - span().begin) / 50) * (event.shiftKey ? 0.1 : 1);
  const around = RATES.indexOf(state.rate);
  const acts = {
    " ": () => play(!state.playing),
    ArrowLeft: () => seek(state.time - step),
    ArrowRight: () => seek(state.time + step),
    Home: () => seek(span().begin),
    End: () => seek(span().end),
    "[": () => jump(false),
    "]": () => jump(true),
    "+": () => zoomStage(1.25),
    "=": () => zoomStage(1.25),
    "-": () => zoomStage(0.8),
    f: fitAll,
    s: () => setRate(RATES[Math.min(around + 1, RATES.length - 1)]),
    S: () => setRate(RATES[Math.max(around - 1, 0)]),
    b: () => toggleLayer("bodies"),
    w: () => toggleLayer("swept"),
    p: () => toggleLayer("path"),
    d: () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"),
    "?": showKeys,
  };
  if (fleet) acts.Escape = () => pick(-1);
  const act = acts[event.key] || (/^[1-9]$/.test(event.key) && (() => pick(Number(event.key) - 1)));
  if (!act || (event.key === " " && /^(BUTTON|INPUT)$/.test(event.target.tagName))) return;
  event.preventDefault();
  act();
}

function zoomStage(factor) {
  stage.view.zoom(factor);
  redraw();
}

function fitAll() {
  stage.view.fit();
  if (space) space.reset();
  redraw();
}

function listenAll() {
  const bar = find("bar");
  scrubbed(bar, (event) => {
    const box = bar.getBoundingClientRect(), { begin, end } = span();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    return begin + share * (end - begin);
  });
  const pathTime = (place) => {
    const { time, apart } = motion().nearest(stage.view.toPlane(place));
    return apart * stage.view.scale <= NEAR ? time : null;
  };
  listen(stage.canvas, {
    drag: (right, down) => {
      stage.view.pan(right, down);
      redraw();
    },
    zoom: (factor, place) => {
      stage.view.zoom(factor, place);
      redraw();
    },
    hover: (place, event) => (fleet ? hoverFleet(place, event) : hoverAt(pathTime(place), event)),
    leave: () => hoverAt(null),
    tap: (place) => {
      const time = pathTime(place), other = fleet ? stage.vehicleAt(place, motions, state) : null;
      if (fleet && (time === null || (other >= 0 && other !== state.choice))) pick(other);
      else if (time !== null) seek(time);
    },
  });
  /** What is known of the vehicle under the pointer; along the path of the one picked, at that time. */
  const hoverFleet = (place, event) => {
    const time = pathTime(place), other = stage.vehicleAt(place, motions, state);
    stage.canvas.style.cursor = other >= 0 ? "pointer" : "";
    if (other < 0 || other === state.choice) return hoverAt(time, event);
    const one = motions[other], rows = [["vehicle", one.name]];
    if (one.reason) rows.push([one.runs.length ? "not arrived" : "no plan", one.reason]);
    else rows.push(["arrives", `${shownNumber(one.end)} s`]);
    state.hover = null;
    showTip(rows, event);
    return redraw();
  };
  stage.canvas.addEventListener("dblclick", fitAll);
  if (space) space.changed = redraw;
  find("play").addEventListener("click", () => play(!state.playing));
  find("closer").addEventListener("click", () => zoomStage(1.25));
  find("farther").addEventListener("click", () => zoomStage(0.8));
  find("fit").addEventListener("click", fitAll);
  find("help").addEventListener("click", showKeys);
  find("theme").addEventListener("click", () =>
    setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
  find("rate").addEventListener("change", (event) => setRate(Number(event.target.value)));
  document.addEventListener("keydown", onKey);
  dark.addEventListener("change", () => setTheme(state.theme));
  new ResizeObserver(() => {
    buildBar();
    redraw();
  }).observe(document.body);
}

function begin() {
  buildHead();
  RATES.forEach((rate) => {
    const option = element("option", "", `${rate}×`);
    option.value = String(rate);
    find("rate").append(option);
  });
  const duration = span().end - span().begin;
  setRate(RATES.find((rate) => rate >= 1 && duration / rate <= LONGEST_FILM) || 16);
  find("transport").hidden = !motions.some((one) => one.runs.length);
  if (space) find("space-plane").hidden = false;
  buildLayers();
  buildKeys();
  buildSearch();
  buildAlternatives();
  buildVehicles();
  const [[left, low], [right, high]] = data.box;
  find("planes").style.setProperty("--shape", String((high - low) / (right - left || 1)));
  setTheme(null);
  buildBar();
  buildCharts();
  listenAll();
  redraw();
}

begin();

// For scripts: the pose [x, y, heading(, z)] in the coordinates of the plan, and the controls of the
// page.
window.player = {
  data,
  poseAt: (time) => motion().poseAt(time).map((value, k) => value + (data.origin[k] || 0)),
  valuesAt,
  seek: (time) => {
    seek(time);
    drawAll();
  },
  pick,
  play,
  setTheme,
  /** Poses of all vehicles of a fleet, or of all plans. */
  posesAt: (time) => motions.map((one) =>
    one.poseAt(time).map((value, k) => value + (data.origin[k] || 0))),
  get time() { return state.time; },
  get choice() { return state.choice; },
  get begin() { return span().begin; },
  get end() { return span().end; },
};
