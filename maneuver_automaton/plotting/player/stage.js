"use strict";
// The plane seen from above: what is around a motion, the motion, and the body at a time.

const NEAR = 14; // px from a path within which the cursor reads it
const MARGINS = { left: 54, right: 12, top: 12, bottom: 46 };
const DART = [[0.6, 0], [-0.4, 0.32], [-0.22, 0], [-0.4, -0.32]];
const DART_SIZE = 0.066; // of the size of the path
const ARROW_SIZE = 0.13;
const LONGEST_ARROW = 64; // px
const DIMMED = 0.3, FULL = 0.85; // bodies of a fleet, while another one is picked, and else
const MOST_LABELS = 40; // vehicles whose names and outlines are shown
const SMALLEST = 4; // px of a dot that stands for a body that is smaller
const FADING = 6; // old plans of a closed loop that are shown

class Stage {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.data = data;
    this.view = new View(canvas, data.box, MARGINS);
    // one path each: filled together, overlapping obstacles would cut holes into each other
    this.still = data.obstacles.filter((one) => !one.t).map(obstaclePath);
    this.moving = data.obstacles.filter((one) => one.t);
    this.regions = new Path2D();
    (data.regions || []).forEach((one) => this.regions.addPath(obstaclePath(one)));
    this.zones = (data.zones || []).map(obstaclePath);
    this.bounds = new Path2D();
    (data.bounds || []).forEach(([from, to]) => {
      this.bounds.moveTo(...from);
      this.bounds.lineTo(...to);
    });
    this.lanes = (data.lanes || []).map((ring) => {
      const path = new Path2D();
      trace(path, ring);
      return path;
    });
    this.swept = new Map();
    this.below = new Still();
    this.above = new Still();
    const ring = DART.map((place) => place.map((c) => c * DART_SIZE * data.mark));
    this.dart = [{ frame: 0, ring }];
  }

  /** Outlines of a vehicle, in a fleet its own; none where the body is not known. */
  bodiesOf(motion) {
    return motion.bodies || this.data.bodies;
  }

  /** The same, with a dart where the body is not known. */
  outlines(motion) {
    const known = this.bodiesOf(motion);
    return known.length ? known : this.dart;
  }

  /**
   * Draw everything at a `time`; `hover` is the time under the cursor, or null. What does not move is
   * kept until the `stamp`, which names all that it shows, or the view changes.
   */
  draw(motion, time, { colors, layers, hover, others, steps, stamp, fleet = null }) {
    const sheet = prepared(this.canvas), { view } = this;
    view.refit();
    this.thin = 1 / view.scale; // a line of one pixel
    const whole = `${stamp} ${view.scale} ${view.middle}`;
    this.below.put(sheet, whole, (context) => {
      this.axes(context, colors, sheet.width, sheet.height);
      this.inMetres(context, () => {
        this.standing(context, colors);
        if (layers.search) this.search(context, colors);
        if (layers.swept && this.bodiesOf(motion).length) this.sweep(context, colors, motion);
      });
    });
    this.inMetres(sheet.context, () => {
      this.traffic(sheet.context, colors, time);
      if (steps) this.plans(sheet.context, colors, time, steps);
    });
    const picked = Boolean(fleet && motion.color); // the overview of a fleet has no colour
    this.above.put(sheet, whole, (context) => this.inMetres(context, () => {
      if (fleet) {
        others.forEach((one) => this.member(context, colors, one, { layers, picked }));
        if (!picked) return;
      } else if (layers.others) {
        others.forEach((other) => this.path(context, other, { width: 1.2, alpha: 0.55 }));
      }
      if (layers.path) this.path(context, motion, { width: 3.2, casing: colors.casing });
      this.ends(context, colors, motion);
      if (layers.bodies) this.switches(context, colors, motion);
    }));
    this.inMetres(sheet.context, () => {
      if (fleet) {
        [...others, motion].forEach((one) =>
          this.held(sheet.context, one, time, picked && one !== motion));
        others.filter((one) => one.isThere(time)).forEach((one) =>
          this.fellow(sheet.context, colors, one, time, { picked, many: others.length > MOST_LABELS }));
        if (!picked) return;
      }
      if (hover !== null) this.body(sheet.context, colors, motion, hover, 0.25);
      if (motion.isThere(time)) this.body(sheet.context, colors, motion, time, picked ? FULL : 0.6);
    });
    if (fleet) {
      const named = others.length <= MOST_LABELS ? others : [];
      this.labels(sheet.context, colors, picked ? [...named, motion] : named, time, motion);
    }
  }

  /** Path, start and goal of a vehicle of a fleet; faint while another one is picked. */
  member(context, colors, motion, { layers, picked }) {
    const alpha = picked ? 0.3 : 0.9;
    if (layers.others && layers.path) {
      this.path(context, motion, { width: picked ? 1.2 : 2, alpha, color: motion.color });
    }
    if (!layers.bodies || !motion.runs.length) return;
    context.lineWidth = 1.3 * this.thin;
    context.strokeStyle = withAlpha(motion.color, 0.9 * alpha);
    context.stroke(this.placed(motion, motion.begin));
    context.fillStyle = withAlpha(motion.color, 0.35 * alpha);
    context.fill(this.placed(motion, motion.end));
    context.stroke(this.placed(motion, motion.end));
  }

  /** What is left of the plan that a vehicle of a fleet holds in closed loop. */
  held(context, motion, time, faint) {
    const plan = motion.isThere(time) && time < motion.end ? motion.heldAt(time) : null;
    if (!plan) return;
    const alpha = faint ? 0.35 : 0.9;
    this.path(context, plan, { width: 1.6, from: time, dash: [6, 4], color: motion.color, alpha });
  }

  /** The body of a vehicle of a fleet that is not picked: a dot where it is tiny on the page. */
  fellow(context, colors, motion, time, { picked, many }) {
    const reach = Math.max(...this.outlines(motion).flatMap((one) => one.ring.flat().map(Math.abs)));
    const alpha = picked ? DIMMED : FULL, dot = SMALLEST * this.thin;
    context.strokeStyle = "transparent";
    if (reach < dot) circle(context, motion.poseAt(time), dot, withAlpha(motion.color, alpha));
    else if (picked || many) {
      const run = motion.runs.length > 0, path = this.placed(motion, time);
      context.fillStyle = withAlpha(run ? motion.color : colors.dim, run ? alpha : 0.2);
      context.fill(path);
      if (!run) this.hatch(context, path, motion.poseAt(time), withAlpha(motion.color, alpha));
    } else this.body(context, colors, motion, time, alpha);
  }

  /** Names beside vehicles, upright; those that are not picked are pale while one is. */
  labels(context, colors, motions, time, picked) {
    context.font = "600 11.5px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.lineJoin = "round";
    context.lineWidth = 3;
    for (const one of motions.filter((member) => member.isThere(time))) {
      const [x, y] = this.view.toPage(one.poseAt(time));
      context.globalAlpha = picked.color && one !== picked ? 0.45 : 1;
      context.strokeStyle = colors.paper;
      context.strokeText(one.label, x + 7, y - 6);
      context.fillStyle = colors.ink;
      context.fillText(one.label, x + 7, y - 6);
    }
    context.globalAlpha = 1;
  }

  /** Number of the vehicle at a place of the canvas: its body, or else its path; -1 if none is. */
  vehicleAt(place, motions, { time, layers }) {
    const there = this.view.toPlane(place), near = NEAR / this.view.scale;
    let best = -1, least = near;
    motions.forEach((one, k) => {
      if (!one.isThere(time)) return;
      const frames = one.framesAt(time), pose = frames[0];
      const hit = this.outlines(one).some((body) => frames[body.frame] &&
        inside(body.ring.map((corner) => acted(frames[body.frame], corner)), there));
      const apart = hit ? -1 : Math.hypot(pose[0] - there[0], pose[1] - there[1]);
      if (apart < least) [best, least] = [k, apart];
    });
    if (best >= 0 || !(layers.others && layers.path)) return best;
    motions.forEach((one, k) => {
      const { apart } = one.nearest(there);
      if (apart < 0.5 * least) [best, least] = [k, 2 * apart];
    });
    return best;
  }

  /** Draw in metres, within the area of the plane. */
  inMetres(context, draw) {
    const { area } = this.view;
    context.save();
    context.beginPath();
    context.rect(area.x, area.y, area.width, area.height);
    context.clip();
    this.view.apply(context);
    draw();
    context.restore();
  }

  axes(context, colors, width, height) {
    const { area } = this.view, { origin } = this.data;
    context.font = "12px system-ui, sans-serif";
    const [x0, y1] = this.view.toPlane([area.x, area.y]);
    const [x1, y0] = this.view.toPlane([area.x + area.width, area.y + area.height]);
    const across = ticks(x0 + origin[0], x1 + origin[0], area.width / 85);
    const up = ticks(y0 + origin[1], y1 + origin[1], area.height / 60);
    context.strokeStyle = colors.grid;
    context.fillStyle = colors.dim;
    context.lineWidth = 1;
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const value of across.values) {
      const [x] = this.view.toPage([value - origin[0], 0]);
      line(context, [x, area.y], [x, area.y + area.height]);
      context.fillText(tickText(value, across.step), x, area.y + area.height + 5);
    }
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const value of up.values) {
      const [, y] = this.view.toPage([0, value - origin[1]]);
      line(context, [area.x, y], [area.x + area.width, y]);
      context.fillText(tickText(value, up.step), area.x - 6, y);
    }
    context.strokeStyle = colors.line;
    context.strokeRect(area.x, area.y, area.width, area.height);
    context.fillStyle = colors.ink;
    context.textAlign = "center";
    context.textBaseline = "bottom";
    context.fillText("x [m]", area.x + area.width / 2, height - 6);
    context.save();
    context.translate(5, area.y + area.height / 2);
    context.rotate(-Math.PI / 2);
    context.textBaseline = "top";
    context.fillText("y [m]", 0, 0);
    context.restore();
  }

  standing(context, colors) {
    context.lineWidth = this.thin;
    context.strokeStyle = colors.paper;
    context.fillStyle = colors.lane;
    for (const lane of this.lanes) {
      context.fill(lane);
      context.stroke(lane);
    }
    context.fillStyle = withAlpha(colors.goal, 0.18);
    context.strokeStyle = colors.goal;
    context.fill(this.regions);
    context.stroke(this.regions);
    context.fillStyle = withAlpha(colors.zone, 0.16);
    context.strokeStyle = colors.zone;
    for (const path of this.zones) {
      context.fill(path, "evenodd");
      context.stroke(path);
    }
    context.strokeStyle = colors.dim;
    context.setLineDash([7 * this.thin, 4 * this.thin]);
    context.stroke(this.bounds);
    context.setLineDash([]);
    context.fillStyle = context.strokeStyle = colors.obstacle;
    for (const path of this.still) {
      context.fill(path, "evenodd");
      context.stroke(path);
    }
  }

  traffic(context, colors, time) {
    context.lineWidth = this.thin;
    for (const one of this.moving) {
      context.strokeStyle = withAlpha(colors.moving, 0.4);
      context.setLineDash([5 * this.thin, 4 * this.thin]);
      context.beginPath();
      one.pose.forEach((pose, n) => context[n ? "lineTo" : "moveTo"](pose[0], pose[1]));
      context.stroke();
      context.setLineDash([]);
      const lasts = one.leaves ? [one.t[0], one.t[one.t.length - 1]] : [null, null];
      const [from, to] = one.present || lasts;
      const there = (from === null || time >= from - 1e-9) && (to === null || time <= to + 1e-9);
      if (one.leaves && !there) continue;
      const path = new Path2D(), pose = posedAt(one, time);
      one.rings.forEach((ring) => trace(path, ring.map((place) => acted(pose, place))));
      context.fillStyle = withAlpha(colors.moving, there ? 0.75 : 0.07);
      context.strokeStyle = withAlpha(colors.moving, there ? 1 : 0.4);
      if (!there) context.setLineDash([4 * this.thin, 3 * this.thin]);
      context.fill(path, "evenodd");
      context.stroke(path);
      context.setLineDash([]);
    }
  }

  search(context, colors) {
    const { nodes, node_costs: costs, reached, narrowest } = this.data.search || {};
    if (reached) {
      const path = new Path2D();
      reached.forEach((ring) => trace(path, ring));
      context.fillStyle = withAlpha(colors.accent, 0.18);
      context.fill(path);
    }
    if (narrowest) {
      context.strokeStyle = colors.broken;
      context.lineWidth = 2.5 * this.thin;
      circle(context, narrowest, 14 * this.thin, withAlpha(colors.broken, 0.2));
    }
    if (!nodes) return;
    const most = costs.reduce((a, b) => Math.max(a, b), 1e-9), size = 2.4 * this.thin;
    nodes.forEach(([x, y], k) => {
      const share = costs.length ? costs[k] / most : 0.5;
      context.fillStyle = `hsl(${Math.round(230 - 190 * share)} 65% 52% / 0.55)`;
      context.fillRect(x - size / 2, y - size / 2, size, size);
    });
  }

  sweep(context, colors, motion) {
    if (!this.swept.has(motion)) this.swept.set(motion, sweptRegion(motion, this.bodiesOf(motion)));
    context.fillStyle = colors.swept;
    context.fill(this.swept.get(motion), "nonzero");
  }

  /** The plan of the step under way from `time` on, and pale those of the steps before. */
  plans(context, colors, time, steps) {
    const now = steps.at(time);
    for (let k = Math.max(0, now - FADING); k < now; k++) {
      const alpha = 0.6 * (1 - (now - k) / (FADING + 1));
      this.path(context, steps.plans[k], { width: 1, alpha, color: colors.dim });
    }
    const plan = steps.plans[now];
    if (plan) this.path(context, plan, { width: 1.6, from: time, dash: [6, 4] });
  }

  /** The path of a motion in the colours of its trims. */
  path(context, motion, { width, alpha = 1, color, casing, from = -Infinity, dash = [] }) {
    context.save();
    context.globalAlpha = alpha;
    context.lineJoin = "round";
    context.setLineDash(dash.map((length) => length * this.thin));
    const draw = (stroke) => {
      context.beginPath();
      let begun = false;
      stroke.times.forEach((at, n) => {
        if (at < from) return;
        const [x, y] = stroke.poses[n];
        context[begun ? "lineTo" : "moveTo"](x, y);
        begun = true;
      });
      context.stroke();
    };
    const strokes = motion.strokes.filter((one) => one.times[one.times.length - 1] >= from);
    if (casing) {
      context.lineWidth = (width + 2) * this.thin;
      context.strokeStyle = casing;
      strokes.forEach(draw);
    }
    context.lineWidth = width * this.thin;
    for (const stroke of strokes) {
      context.strokeStyle = color || this.data.trims[stroke.trim].color;
      draw(stroke);
    }
    context.restore();
  }

  ends(context, colors, motion) {
    const size = Math.min(ARROW_SIZE * this.data.mark, LONGEST_ARROW * this.thin);
    const start = motion.poses[0];
    context.lineWidth = 1.6 * this.thin;
    const arrow = (pose, color) => {
      context.strokeStyle = context.fillStyle = color;
      const tip = acted(pose, [size, 0]);
      line(context, pose, acted(pose, [0.75 * size, 0]));
      context.beginPath();
      context.moveTo(...tip);
      context.lineTo(...acted(pose, [0.7 * size, 0.12 * size]));
      context.lineTo(...acted(pose, [0.7 * size, -0.12 * size]));
      context.fill();
    };
    for (const goal of motion.goals || this.data.goals) {
      const color = goal.reached ? colors.goal : colors.dim;
      context.strokeStyle = color;
      if (goal.tolerance > 0) circle(context, goal.pose, goal.tolerance, withAlpha(color, 0.15));
      if (!goal.free) arrow(goal.pose, color);
      circle(context, goal.pose, 5.5 * this.thin, colors.paper);
      circle(context, goal.pose, 2.2 * this.thin, color);
    }
    arrow(start, colors.ink);
    circle(context, start, 4.5 * this.thin, colors.paper);
  }

  /** The body where trims begin, and at the end. */
  switches(context, colors, motion) {
    if (!this.bodiesOf(motion).length) return;
    context.lineWidth = 0.8 * this.thin;
    const times = [...motion.runs.map((run) => run.begin), motion.end];
    const alpha = Math.max(0.22, 0.6 * Math.min(1, 10 / times.length));
    for (const time of times) {
      const whole = time === motion.begin || time === motion.end;
      context.strokeStyle = withAlpha(colors.ink, whole ? 0.8 : alpha);
      context.stroke(this.placed(motion, time));
    }
  }

  body(context, colors, motion, time, alpha) {
    const run = motion.runs.length ? motion.runAt(time) : null;
    const path = this.placed(motion, time), pose = motion.poseAt(time);
    const color = motion.color || (run ? this.data.trims[run.trim].color : colors.dim);
    context.fillStyle = run ? withAlpha(color, alpha) : withAlpha(colors.dim, 0.2);
    context.strokeStyle = withAlpha(colors.ink, Math.min(1, alpha + 0.4));
    context.lineWidth = 1.4 * this.thin;
    context.lineJoin = "round";
    context.fill(path);
    context.stroke(path);
    if (!run && motion.color) this.hatch(context, path, pose, withAlpha(motion.color, alpha));
    if (!this.bodiesOf(motion).length) return;
    const front = Math.max(...this.outlines(motion).filter((one) => !one.frame)
      .flatMap((one) => one.ring.map((place) => place[0])));
    line(context, pose, acted(pose, [0.85 * front, 0])); // where it looks
    circle(context, pose, 2.2 * this.thin, colors.ink);
  }

  /** Slanting lines over a body: it has no plan. */
  hatch(context, path, [x, y], color) {
    const step = 5 * this.thin, reach = 400 * this.thin;
    context.save();
    context.clip(path);
    context.strokeStyle = color;
    context.lineWidth = 1.3 * this.thin;
    for (let off = -reach; off <= reach; off += step) {
      line(context, [x + off - reach, y - reach], [x + off + reach, y + reach]);
    }
    context.restore();
  }

  placed(motion, time) {
    const path = new Path2D(), frames = motion.framesAt(time);
    for (const body of this.outlines(motion)) {
      const frame = frames[body.frame];
      if (frame) trace(path, body.ring.map((place) => acted(frame, place)));
    }
    return path;
  }
}

/** The path around an obstacle in its own frame; a map's blocked cells where its origin puts them. */
function obstaclePath(one) {
  const path = new Path2D();
  if (!one.cells) {
    one.rings.forEach((ring) => trace(path, ring));
    return path;
  }
  for (let k = 0; k < one.cells.length; k += 4) {
    const [x0, y0, x1, y1] = one.cells.slice(k, k + 4).map((number) => number * one.cell);
    trace(path, [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map((place) => acted(one.origin, place)));
  }
  return path;
}
