"use strict";
// Canvases of the right resolution, and a view of the plane in equal scales that can be moved.

/** Fit a canvas to its place on the page; returns its context in CSS pixels, and its size. */
function prepared(canvas) {
  const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  const wide = Math.max(1, Math.round(box.width * ratio));
  const high = Math.max(1, Math.round(box.height * ratio));
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, box.width, box.height);
  return { context, width: box.width, height: box.height, ratio };
}

/** A picture of what does not move with the time, drawn again only when its `stamp` changes. */
class Still {
  constructor() {
    this.canvas = document.createElement("canvas");
  }

  /** Put the picture on a canvas that is `prepared`; `draw(context)` makes it. */
  put({ context, width, height, ratio }, stamp, draw) {
    const whole = `${stamp} ${width} ${height} ${ratio}`;
    if (this.stamp !== whole) {
      this.stamp = whole;
      this.canvas.width = Math.max(1, Math.round(width * ratio));
      this.canvas.height = Math.max(1, Math.round(height * ratio));
      const own = this.canvas.getContext("2d");
      own.setTransform(ratio, 0, 0, ratio, 0, 0);
      draw(own);
    }
    context.drawImage(this.canvas, 0, 0, width, height);
  }
}

/** Colours of the theme by name, as the style sheet has them. */
function themeColors() {
  const style = getComputedStyle(document.documentElement);
  return new Proxy({}, { get: (_, name) => style.getPropertyValue("--" + String(name)).trim() });
}

/** A round step of 1, 2 or 5 times a power of ten, of at least `least`. */
function roundStep(least) {
  const tens = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((n) => n * tens).find((step) => step >= least * (1 - 1e-9));
}

/** Round numbers from `low` to `high`, at most about `many`, but no fewer than two. */
function ticks(low, high, many) {
  const step = roundStep((high - low) / Math.max(1, many) || 1), found = [];
  if (Math.floor(high / step) - Math.ceil(low / step) < 1 && many < 20) {
    return ticks(low, high, many + 1);
  }
  for (let n = Math.ceil(low / step); n * step <= high * (1 + 1e-12) + 1e-12; n++) {
    found.push(n * step);
    if (found.length > 60) break;
  }
  return { step, values: found };
}

/** A number with as many decimals as a step between numbers asks for. */
function tickText(value, step) {
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = value.toFixed(Math.min(digits, 8));
  return Number(text) === 0 ? (0).toFixed(Math.min(digits, 8)) : text.replace("-", "−");
}

/** A number for a reader: three to four digits, a proper minus. */
function shownNumber(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Math.abs(value) < 5e-10) return "0";
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

function line(context, from, to) {
  context.beginPath();
  context.moveTo(from[0], from[1]);
  context.lineTo(to[0], to[1]);
  context.stroke();
}

function circle(context, middle, radius, fill) {
  context.beginPath();
  context.arc(middle[0], middle[1], radius, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.stroke();
}

/** A colour "#rrggbb" that lets through what is below. */
function withAlpha(color, alpha) {
  const share = Math.round(255 * Math.min(Math.max(alpha, 0), 1));
  return color + share.toString(16).padStart(2, "0");
}

class View {
  /** A view of a box [[x, y], [x, y]], `margins` {left, right, top, bottom} of the canvas left out. */
  constructor(canvas, box, margins) {
    Object.assign(this, { canvas, box, margins, free: false, scale: 1, middle: [0, 0] });
    this.refit();
  }

  /** Measure the canvas; show the whole box, unless the reader has moved the view. */
  refit() {
    const { left, right, top, bottom } = this.margins;
    const { width, height } = this.canvas.getBoundingClientRect();
    const area = { x: left, y: top, width: width - left - right, height: height - top - bottom };
    this.area = area; // of the canvas in which the plane is shown
    if (this.free) return;
    const [[x0, y0], [x1, y1]] = this.box;
    const wide = Math.max(x1 - x0, 1e-6), high = Math.max(y1 - y0, 1e-6);
    this.scale = 0.94 * Math.min(area.width / wide, area.height / high);
    this.middle = [(x0 + x1) / 2, (y0 + y1) / 2];
  }

  fit() {
    this.free = false;
    this.refit();
  }

  toPage([x, y]) {
    const area = this.area;
    return [
      area.x + area.width / 2 + (x - this.middle[0]) * this.scale,
      area.y + area.height / 2 - (y - this.middle[1]) * this.scale,
    ];
  }

  toPlane([x, y]) {
    const area = this.area;
    return [
      this.middle[0] + (x - area.x - area.width / 2) / this.scale,
      this.middle[1] - (y - area.y - area.height / 2) / this.scale,
    ];
  }

  /** Have a context draw in metres. */
  apply(context) {
    const [x, y] = this.toPage([0, 0]);
    context.transform(this.scale, 0, 0, -this.scale, x, y);
  }

  zoom(factor, at) {
    const area = this.area;
    const place = at || [area.x + area.width / 2, area.y + area.height / 2];
    const [x, y] = this.toPlane(place);
    this.scale = Math.min(Math.max(this.scale * factor, 1e-4), 1e6);
    const [u, v] = this.toPlane(place);
    this.middle = [this.middle[0] + x - u, this.middle[1] + y - v];
    this.free = true;
  }

  pan(right, down) {
    this.middle = [this.middle[0] - right / this.scale, this.middle[1] + down / this.scale];
    this.free = true;
  }
}

/**
 * Have drags and the wheel move something: `drag(dx, dy)`, `zoom(factor, place)`; `hover(place)` and
 * `leave()` tell where the pointer is without a button.
 */
function listen(canvas, { drag, zoom, hover, leave, tap }) {
  const fingers = new Map();
  let moved = 0;
  const at = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const now = at(event), before = fingers.get(event.pointerId);
    if (!before) return hover && hover(now, event);
    const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (others.length) {
      const apart = (place) => Math.hypot(place[0] - others[0][0], place[1] - others[0][1]);
      zoom(apart(now) / Math.max(apart(before), 1), others[0]);
    } else drag(now[0] - before[0], now[1] - before[1]);
    fingers.set(event.pointerId, now);
    return leave && leave();
  });
  const release = (event) => {
    const known = fingers.delete(event.pointerId);
    if (known && event.type === "pointerup" && moved < 4 && tap) tap(at(event));
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("pointerleave", () => leave && leave());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at(event));
  }, { passive: false });
}
