"use strict";
// A motion is a sequence of arcs, each of one constant twist. A pose is [x, y, heading(, z)], seen
// from the origin of the page. Poses here are those of Plan.pose_at, by the same formulas.

/** Motion of a body with a `twist` [v_x, v_y, turn rate(, v_z)] after `time` s from the identity. */
function exponential(twist, time) {
  const half = (twist[2] * time) / 2;
  // sin(half) / half without cancellation, and one at zero
  const chord = Math.abs(half) < 1e-12 ? 1 : Math.sin(half) / half;
  const along = chord * Math.cos(half), aside = chord * Math.sin(half);
  const step = [
    time * (along * twist[0] - aside * twist[1]),
    time * (aside * twist[0] + along * twist[1]),
    time * twist[2],
  ];
  if (twist.length > 3) step.push(time * twist[3]);
  return step;
}

/** Pose reached by a `step` in the frame of a `pose`. */
function composed(pose, step) {
  const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
  const sum = [
    pose[0] + c * step[0] - s * step[1],
    pose[1] + s * step[0] + c * step[1],
    pose[2] + step[2],
  ];
  if (pose.length > 3) sum.push(pose[3] + (step.length > 3 ? step[3] : 0));
  return sum;
}

/** A place [x, y] of a body at a `pose`, seen from the page. */
function acted(pose, place) {
  const c = Math.cos(pose[2]), s = Math.sin(pose[2]);
  return [pose[0] + c * place[0] - s * place[1], pose[1] + s * place[0] + c * place[1]];
}

/** Number of the last of the rising `times` that is not after `time`; -1 before the first. */
function lastNotAfter(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

/** Value of a curve {t, v} at a time, linear between its corners, held outside. */
function curveAt(curve, time) {
  const k = lastNotAfter(curve.t, time);
  if (k < 0) return curve.v[0];
  if (k >= curve.t.length - 1) return curve.v[curve.v.length - 1];
  const share = (time - curve.t[k]) / (curve.t[k + 1] - curve.t[k] || 1);
  return curve.v[k] + share * (curve.v[k + 1] - curve.v[k]);
}

/** Pose in time of {t, pose}, every number linear between its samples, held outside. */
function posedAt(course, time) {
  const last = course.t.length - 1;
  const k = Math.min(Math.max(lastNotAfter(course.t, time), 0), last);
  if (k === last || time <= course.t[0]) return course.pose[k];
  const share = (time - course.t[k]) / (course.t[k + 1] - course.t[k] || 1);
  return course.pose[k].map((value, n) => value + share * (course.pose[k + 1][n] - value));
}

const CHORD_RAD = 0.03; // between drawn points of an arc
const MOST_PART_S = 0.05; // between samples of a body that carries others

class Motion {
  constructor(entry) {
    Object.assign(this, entry); // times, poses, twists, trims, and what was measured along them
    this.parts = entry.parts || [];
    this.curves = entry.curves || [];
    this.held = (entry.held || []).map(({ t, plan }) => ({ t, plan: new Motion(plan) }));
    this.begin = this.times[0];
    this.end = this.times[this.times.length - 1];
    this.runs = this.trimRuns();
  }

  /** Number of the arc at a time. */
  arcAt(time) {
    return Math.min(Math.max(lastNotAfter(this.times, time), 0), this.twists.length - 1);
  }

  /** Pose at a time, held before the begin and after the end. */
  poseAt(time) {
    if (!this.twists.length || time >= this.end) return this.poses[this.poses.length - 1];
    const k = this.arcAt(time);
    const since = Math.max(0, time - this.times[k]);
    return composed(this.poses[k], exponential(this.twists[k], since));
  }

  /** Frames of the body, and of what it carries, at a time. */
  framesAt(time) {
    const pose = this.poseAt(time);
    return [pose, ...this.parts.map((course) => composed(pose, posedAt(course, time)))];
  }

  /** Whether it is under way at a time: others of its fleet may begin before it, and end after. */
  drivesAt(time) {
    return this.twists.length > 0 && time >= this.begin && time <= this.end;
  }

  /** Speed [m/s], climbing included. */
  speedAt(time) {
    if (!this.drivesAt(time)) return 0;
    const twist = this.twists[this.arcAt(time)];
    return Math.hypot(twist[0], twist[1], twist[3] || 0);
  }

  /** Runs of arcs of one trim: {trim, begin, end}. */
  trimRuns() {
    const runs = [];
    this.trims.forEach((trim, k) => {
      const last = runs[runs.length - 1];
      if (last && last.trim === trim) last.end = this.times[k + 1];
      else runs.push({ trim, begin: this.times[k], end: this.times[k + 1] });
    });
    return runs;
  }

  runAt(time) {
    return this.runs.find((run) => time < run.end) || this.runs[this.runs.length - 1];
  }

  /** Times of an arc, close enough for drawing. */
  arcTimes(k) {
    const begin = this.times[k], span = this.times[k + 1] - begin;
    let steps = Math.ceil(Math.abs(this.twists[k][2] * span) / CHORD_RAD);
    if (this.parts.length) steps = Math.max(steps, Math.ceil(span / MOST_PART_S));
    const times = [];
    for (let n = 0, many = Math.max(1, steps); n <= many; n++) times.push(begin + (span * n) / many);
    return times;
  }

  /** Poses along every arc: [{trim, times, poses}], made once. */
  get strokes() {
    if (!this._strokes) {
      this._strokes = this.twists.map((twist, k) => {
        const times = this.arcTimes(k);
        const poses = times.map((time) =>
          composed(this.poses[k], exponential(twist, time - this.times[k])));
        return { trim: this.trims[k], times, poses };
      });
    }
    return this._strokes;
  }

  /** Whether it is there at a time: it may leave once it has arrived. */
  isThere(time) {
    return !(this.leaves && time > this.end) && !(this.joins && time < this.begin);
  }

  /** The plan that it holds at a time of a closed loop; null if it holds none. */
  heldAt(time) {
    const k = lastNotAfter(this.held.map(({ t }) => t), time);
    return k < 0 ? null : this.held[k].plan;
  }

  /** Time at which the path passes next to a place, and how far that is [m]. */
  nearest(place) {
    let best = { time: this.begin, apart: Infinity };
    for (const stroke of this.strokes) {
      for (let n = 1; n < stroke.poses.length; n++) {
        const [a, b] = [stroke.poses[n - 1], stroke.poses[n]];
        const [x, y] = [b[0] - a[0], b[1] - a[1]];
        const square = x * x + y * y;
        const along = square ? ((place[0] - a[0]) * x + (place[1] - a[1]) * y) / square : 0;
        const share = Math.min(Math.max(along, 0), 1);
        const apart = Math.hypot(a[0] + share * x - place[0], a[1] + share * y - place[1]);
        if (apart < best.apart) {
          const time = stroke.times[n - 1] + share * (stroke.times[n] - stroke.times[n - 1]);
          best = { time, apart };
        }
      }
    }
    return best;
  }
}

/** Corners of the smallest convex polygon around places, counter-clockwise (monotone chain). */
function hull(places) {
  const sorted = places.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const chain = (list) => {
    const side = [];
    for (const p of list) {
      while (side.length > 1) {
        const [a, b] = side.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        side.pop();
      }
      side.push(p);
    }
    side.pop();
    return side;
  };
  return [...chain(sorted), ...chain(sorted.reverse())];
}

/**
 * What the bodies sweep. On every arc each convex piece of a body fills the hull of its places at
 * two samples. All hulls turn the same way, so filled together they are their union.
 */
function sweptRegion(motion, bodies) {
  const path = new Path2D();
  for (const { times, poses } of motion.strokes) {
    const frames = times.map((time, n) =>
      [poses[n], ...motion.parts.map((one) => composed(poses[n], posedAt(one, time)))]);
    for (const body of bodies) {
      for (const piece of body.convex) {
        const at = frames.map((frame) => piece.map((place) => acted(frame[body.frame], place)));
        for (let n = 1; n < at.length; n++) trace(path, hull([...at[n - 1], ...at[n]]));
      }
    }
  }
  return path;
}

/** Whether a place is inside a ring (even-odd rule). */
function inside(ring, [x, y]) {
  let odd = false;
  ring.forEach(([x1, y1], n) => {
    const [x0, y0] = ring[(n || ring.length) - 1];
    if ((y0 > y) !== (y1 > y) && x < x0 + ((y - y0) / (y1 - y0)) * (x1 - x0)) odd = !odd;
  });
  return odd;
}

/** Add a closed ring of places to a path. */
function trace(path, ring) {
  ring.forEach((place, n) => (n ? path.lineTo(place[0], place[1]) : path.moveTo(place[0], place[1])));
  path.closePath();
}
