"use strict";
// Curves over time beside the plane, and the cost and the bound over the time of the search.

/** Range of values with zero and a little room, as the pictures have it. */
function roomFor(values) {
  let low = Math.min(...values), high = Math.max(...values);
  const share = (high - low) / (Math.max(Math.abs(low), Math.abs(high)) || 1);
  if (share > 0.2 || share < 1e-3) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  const room = 0.12 * (high - low) || 1;
  return [low - room, high + room];
}

/** One quantity over the time of a motion, drawn once, with a cursor over it. */
class Chart {
  /** A `level` is a line across, say a margin. */
  constructor(parent, { label, value, points, last, level = null }) {
    Object.assign(this, { label, value, points, last, level });
    this.holder = document.createElement("div");
    this.holder.className = "chart";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("aria-label", label);
    this.holder.append(this.canvas);
    if (last) this.holder.style.flexBasis = "100px";
    parent.append(this.holder);
    const values = points.map((point) => point[1]);
    this.range = roomFor(level === null ? values : [...values, level]);
    this.still = new Still();
  }

  get area() {
    const box = this.canvas.getBoundingClientRect();
    return { x: 46, y: 20, width: box.width - 54, height: box.height - 24 - (this.last ? 32 : 0) };
  }

  timeAt(x) {
    const area = this.area, { begin, end } = this.span;
    return begin + Math.min(Math.max((x - area.x) / area.width, 0), 1) * (end - begin);
  }

  across(time) {
    const area = this.area, { begin, end } = this.span;
    return area.x + (area.width * (time - begin)) / (end - begin || 1);
  }

  up(value) {
    const area = this.area, [low, high] = this.range;
    return area.y + (area.height * (high - value)) / (high - low);
  }

  draw(motion, span, time, hover, colors, trims, stamp) {
    this.span = { begin: span.begin, end: span.end };
    const sheet = prepared(this.canvas), { context } = sheet;
    this.still.put(sheet, stamp, (below) => this.curve(below, motion, colors, trims));
    const area = this.area;
    context.lineWidth = 1;
    for (const [at, color] of [[hover, colors.dim], [time, colors.ink]]) {
      if (at === null) continue;
      context.strokeStyle = context.fillStyle = color;
      const x = this.across(at);
      line(context, [x, area.y], [x, area.y + area.height]);
      context.beginPath();
      context.arc(x, this.up(this.value(at)), 3, 0, 2 * Math.PI);
      context.fill();
    }
    context.font = "600 12.5px system-ui, sans-serif";
    context.textAlign = "right";
    context.textBaseline = "top";
    context.fillStyle = colors.ink;
    context.fillText(shownNumber(this.value(hover ?? time), 3), area.x + area.width, 3);
  }

  /** Everything that does not move with the time. */
  curve(context, motion, colors, trims) {
    const area = this.area, [low, high] = this.range;
    context.font = "12.5px system-ui, sans-serif";
    context.textBaseline = "top";
    context.fillStyle = colors.ink;
    context.fillText(this.label, area.x, 3);
    context.font = "11.5px system-ui, sans-serif";
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.lineWidth = 1;
    const levels = ticks(low, high, Math.max(2, area.height / 26));
    for (const value of levels.values) {
      context.strokeStyle = Math.abs(value) < 1e-12 ? colors.line : colors.grid;
      line(context, [area.x, this.up(value)], [area.x + area.width, this.up(value)]);
      context.fillStyle = colors.dim;
      context.fillText(tickText(value, levels.step), area.x - 6, this.up(value));
    }
    context.strokeStyle = colors.line;
    context.strokeRect(area.x, area.y, area.width, area.height);
    if (this.level !== null) {
      context.strokeStyle = colors.broken;
      line(context, [area.x, this.up(this.level)], [area.x + area.width, this.up(this.level)]);
    }
    context.lineJoin = "round";
    const draw = () => {
      context.beginPath();
      this.points.forEach(([at, value], n) =>
        context[n ? "lineTo" : "moveTo"](this.across(at), this.up(value)));
      context.stroke();
    };
    if (motion.begin > this.span.begin || motion.end < this.span.end || !motion.runs.length) {
      context.lineWidth = motion.runs.length ? 1 : 1.8;
      context.strokeStyle = motion.runs.length ? colors.dim : colors.accent;
      draw();
    }
    context.lineWidth = 2.2;
    for (const run of motion.runs) {
      context.save();
      context.beginPath();
      const left = this.across(run.begin), right = this.across(run.end);
      context.rect(left - 0.5, area.y, right - left + 1, area.height);
      context.clip();
      context.strokeStyle = trims[run.trim].color;
      draw();
      context.restore();
    }
    if (this.last) this.timeAxis(context, colors);
  }

  timeAxis(context, colors) {
    const area = this.area, { begin, end } = this.span;
    const found = ticks(begin, end, area.width / 60);
    context.fillStyle = colors.dim;
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const value of found.values) {
      context.fillText(tickText(value, found.step), this.across(value), area.y + area.height + 4);
    }
    context.fillStyle = colors.ink;
    context.fillText("time [s]", area.x + area.width / 2, area.y + area.height + 18);
  }
}

/** Cost of the best plan, the bound below it and the gap between, over the time of the search. */
class SearchChart {
  constructor(canvas, search) {
    this.canvas = canvas;
    const [costs, bounds] = [search.costs.slice(), search.bounds.slice()];
    const last = Math.max(...costs.map(([at]) => at), ...bounds.map(([at]) => at), 1e-2);
    if (!costs.length) costs.push([1e-3, search.cost]);
    if (!bounds.length && search.bound !== null) bounds.push([1e-3, search.bound]);
    Object.assign(this, { costs, bounds, end: 1.3 * last, kind: search.kind });
    this.begin = Math.min(...costs.map(([at]) => at), ...bounds.map(([at]) => at));
    this.begin = Math.max(1e-3, Math.min(this.begin, 0.5 * this.end));
    const final = costs[costs.length - 1][1];
    const costliest = Math.max(...costs.map(([, cost]) => cost));
    const least = bounds.length ? bounds[0][1] : Math.min(...costs.map(([, cost]) => cost));
    const top = Math.min(costliest, 1.6 * final), bottom = Math.min(least, final);
    const room = 0.12 * (top - bottom) || 0.1 * Math.abs(final) || 1;
    this.range = [bottom - room, top + room];
  }

  /** The last value of steps [[time, value]] at a time; null before the first. */
  static at(steps, time) {
    const k = lastNotAfter(steps.map(([at]) => at), time);
    return k < 0 ? null : steps[k][1];
  }

  readAt(x) {
    const { x: left, width } = this.area();
    const share = Math.min(Math.max((x - left) / width, 0), 1);
    const time = this.begin * (this.end / this.begin) ** share;
    const cost = SearchChart.at(this.costs, time), bound = SearchChart.at(this.bounds, time);
    return { time, cost, bound };
  }

  area() {
    const box = this.canvas.getBoundingClientRect();
    return { x: 52, y: 8, width: box.width - 60, height: box.height - 50 };
  }

  draw(colors, hover) {
    const { context } = prepared(this.canvas), area = this.area();
    const log = Math.log(this.end / this.begin);
    const across = (time) =>
      area.x + (area.width * Math.log(Math.max(time, this.begin) / this.begin)) / log;
    const up = (value) =>
      area.y + (area.height * (this.range[1] - value)) / (this.range[1] - this.range[0]);
    context.font = "11.5px system-ui, sans-serif";
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    const levels = ticks(...this.range, area.height / 30);
    for (const value of levels.values) {
      context.strokeStyle = colors.grid;
      line(context, [area.x, up(value)], [area.x + area.width, up(value)]);
      context.fillStyle = colors.dim;
      context.fillText(tickText(value, levels.step), area.x - 6, up(value));
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (let n = Math.ceil(Math.log10(this.begin) - 1e-9); 10 ** n <= this.end; n++) {
      const x = across(10 ** n);
      context.strokeStyle = colors.grid;
      line(context, [x, area.y], [x, area.y + area.height]);
      context.fillText(String(Number((10 ** n).toPrecision(1))), x, area.y + area.height + 7);
    }
    context.fillStyle = colors.ink;
    context.fillText("time since the search began [s]", area.x + area.width / 2,
      area.y + area.height + 23);
    context.strokeStyle = colors.line;
    context.strokeRect(area.x, area.y, area.width, area.height);
    context.save();
    context.beginPath();
    context.rect(area.x, area.y, area.width, area.height);
    context.clip();
    const corners = (steps) => {
      const list = steps.flatMap(([at, value], n) =>
        (n ? [[at, steps[n - 1][1]], [at, value]] : [[at, value]]));
      list.push([this.end, steps[steps.length - 1][1]]);
      return list.map(([at, value]) => [across(at), up(value)]);
    };
    this.shade(context, colors, { across, up });
    for (const [steps, color] of [[this.bounds, colors.bound], [this.costs, colors.accent]]) {
      if (!steps.length) continue;
      context.strokeStyle = context.fillStyle = color;
      context.lineWidth = 2;
      context.beginPath();
      corners(steps).forEach((place, n) => context[n ? "lineTo" : "moveTo"](...place));
      context.stroke();
      for (const [at, value] of steps) {
        context.beginPath();
        context.arc(across(at), up(value), 3, 0, 2 * Math.PI);
        context.fill();
      }
    }
    if (hover !== null) {
      context.strokeStyle = colors.dim;
      line(context, [hover, area.y], [hover, area.y + area.height]);
    }
    context.restore();
  }

  /** Shade the gap between cost and bound. */
  shade(context, colors, { across, up }) {
    const times = [...this.costs, ...this.bounds].map(([at]) => at).sort((a, b) => a - b);
    times.push(this.end);
    context.fillStyle = withAlpha(colors.dim, 0.16);
    for (let n = 1; n < times.length; n++) {
      const [from, to] = [times[n - 1], times[n]];
      const cost = SearchChart.at(this.costs, from), bound = SearchChart.at(this.bounds, from);
      if (cost === null || bound === null) continue;
      context.fillRect(across(from), up(cost), across(to) - across(from), up(bound) - up(cost));
    }
  }
}
