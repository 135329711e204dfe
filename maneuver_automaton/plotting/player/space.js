"use strict";
// Space in parallel projection: buildings as prisms, the path above its shadow on the ground.

const HIDDEN = 0.28; // opacity of the path behind a building

class Space {
  constructor(canvas, data) {
    Object.assign(this, { canvas, data, azimuth: -1.19, elevation: 0.73, scale: 1, shift: [0, 0] });
    const tall = data.obstacles.filter((one) => !one.t && !one.cells && one.height);
    this.still = new Still();
    this.prisms = tall.map((one) => ({ ring: one.rings[0], low: one.height[0], high: one.height[1] }));
    this.listening();
  }

  listening() {
    const redraw = () => this.changed && this.changed();
    listen(this.canvas, {
      drag: (right, down) => {
        this.azimuth -= 0.008 * right;
        this.elevation = Math.min(Math.max(this.elevation + 0.008 * down, 0.02), Math.PI / 2);
        redraw();
      },
      zoom: (factor) => {
        this.scale = Math.min(Math.max(this.scale * factor, 0.2), 20);
        redraw();
      },
    });
  }

  reset() {
    Object.assign(this, { azimuth: -1.19, elevation: 0.73, scale: 1 });
  }

  /** Right and down on the page, and depth, of [x, y, z], before scaling. */
  turned([x, y, z]) {
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [up, flat] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const right = -s * x + c * y, away = -(c * x + s * y); // the eye looks from the azimuth
    return [right, -(away * flat + z * up), away * up - z * flat];
  }

  draw(motion, time, { colors, hover, stamp }) {
    const sheet = prepared(this.canvas), { context, width, height } = sheet;
    const ground = Math.min(0, ...motion.poses.map((pose) => pose[3]));
    this.highest = Math.max(...motion.poses.map((pose) => pose[3]));
    const corners = this.corners(motion, ground).map((place) => this.turned(place));
    const [xs, ys] = [corners.map((c) => c[0]), corners.map((c) => c[1])];
    const box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const scale = 0.84 * this.scale
      * Math.min(width / (box[1] - box[0] || 1), height / (box[3] - box[2] || 1));
    const middle = [(box[0] + box[1]) / 2, (box[2] + box[3]) / 2];
    this.page = (place) => {
      const [right, down] = this.turned(place);
      return [width / 2 + scale * (right - middle[0]), height / 2 + scale * (down - middle[1])];
    };
    this.still.put(sheet, `${stamp} ${this.azimuth} ${this.elevation} ${this.scale}`, (below) => {
      this.groundGrid(below, colors, ground);
      this.shadow(below, colors, motion, ground);
      this.buildings(below, colors);
      this.path(below, motion);
      this.marks(below, colors, motion);
    });
    if (hover !== null) this.vehicle(context, colors, motion, hover, ground, 0.35);
    this.vehicle(context, colors, motion, time, ground, 1);
  }

  corners(motion, ground) {
    const [[x0, y0], [x1, y1]] = this.data.box;
    const flat = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(([x, y]) => [x, y, ground]);
    const tops = this.prisms.flatMap(({ ring, high }) => ring.map(([x, y]) => [x, y, high]));
    return [...flat, ...tops, ...motion.poses.map((pose) => [pose[0], pose[1], pose[3]])];
  }

  groundGrid(context, colors, ground) {
    const [[x0, y0], [x1, y1]] = this.data.box, { origin } = this.data;
    context.fillStyle = colors.panel;
    context.strokeStyle = colors.line;
    this.face(context, colors, [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map((at) => [...at, ground]));
    context.strokeStyle = colors.line;
    context.fillStyle = colors.dim;
    context.lineWidth = 1;
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    const across = ticks(x0 + origin[0], x1 + origin[0], 6);
    const step = across.step, up = ticks(y0 + origin[1], y1 + origin[1], (y1 - y0) / step);
    const near = (a, b, fixed, make) => (this.turned(make(a, fixed))[2] < this.turned(make(b, fixed))[2] ? a : b);
    for (const value of across.values) {
      const x = value - origin[0], make = (y, at) => [at, y, ground];
      line(context, this.page([x, y0, ground]), this.page([x, y1, ground]));
      const y = near(y0, y1, x, make), out = y === y0 ? -1 : 1;
      context.fillText(tickText(value, step), ...this.page([x, y + 0.3 * step * out, ground]));
    }
    for (const value of up.values) {
      const y = value - origin[1], make = (x, at) => [x, at, ground];
      line(context, this.page([x0, y, ground]), this.page([x1, y, ground]));
      const x = near(x0, x1, y, make), out = x === x0 ? -1 : 1;
      context.fillText(tickText(value, up.step), ...this.page([x + 0.3 * step * out, y, ground]));
    }
    context.textAlign = "left";
    context.fillText("x, y, z [m]", 12, 18);
    this.heightAxis(context, [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], ground);
  }

  /** Altitudes beside the corner of the ground that is leftmost on the page. */
  heightAxis(context, corners, ground) {
    const left = corners.reduce((a, b) => (this.page([...a, 0])[0] < this.page([...b, 0])[0] ? a : b));
    const top = Math.max(...this.prisms.map((one) => one.high), this.highest);
    line(context, this.page([...left, ground]), this.page([...left, top]));
    const levels = ticks(ground, top, 4);
    context.textAlign = "right";
    for (const z of levels.values) {
      const [x, y] = this.page([...left, z]);
      line(context, [x - 4, y], [x, y]);
      context.fillText(tickText(z, levels.step), x - 7, y);
    }
  }

  buildings(context, colors) {
    const depth = ({ ring }) => Math.min(...ring.map(([x, y]) => this.turned([x, y, 0])[2]));
    const sorted = this.prisms.slice().sort((a, b) => depth(b) - depth(a)); // the farthest first
    context.lineJoin = "round";
    for (const { ring, low, high } of sorted) {
      const area = ring.reduce((sum, [x, y], n) => {
        const [u, v] = ring[(n + 1) % ring.length];
        return sum + x * v - u * y;
      }, 0);
      ring.forEach(([x, y], n) => {
        const [u, v] = ring[(n + 1) % ring.length];
        const [normalX, normalY] = [(v - y) * Math.sign(area), (x - u) * Math.sign(area)];
        const facing = normalX * Math.cos(this.azimuth) + normalY * Math.sin(this.azimuth);
        if (facing <= 0) return;
        const shade = 0.5 + 0.5 * (facing / (Math.hypot(normalX, normalY) || 1));
        context.fillStyle = mixed(colors.wall, colors.roof, shade * 0.75);
        this.face(context, colors, [[x, y, low], [u, v, low], [u, v, high], [x, y, high]]);
      });
      context.fillStyle = colors.roof;
      this.face(context, colors, ring.map(([x, y]) => [x, y, high]));
    }
  }

  face(context, colors, places) {
    context.beginPath();
    places.forEach((place, n) => context[n ? "lineTo" : "moveTo"](...this.page(place)));
    context.closePath();
    context.fill();
    context.strokeStyle = withAlpha(colors.paper, 0.55);
    context.lineWidth = 0.8;
    context.stroke();
  }

  /** Whether a building stands between a place and the eye. */
  hidden([x, y, z]) {
    const [c, s] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const climb = Math.tan(this.elevation);
    return this.prisms.some(({ ring, low, high }) => ring.some(([a, b], n) => {
      const [u, v] = ring[(n + 1) % ring.length];
      const cross = c * (v - b) - s * (u - a);
      if (Math.abs(cross) < 1e-12) return false;
      const along = ((a - x) * (v - b) - (b - y) * (u - a)) / cross;
      const share = ((a - x) * s - (b - y) * c) / cross;
      const height = z + along * climb;
      return along > 1e-6 && share >= 0 && share <= 1 && height >= low && height <= high;
    }));
  }

  shadow(context, colors, motion, ground) {
    context.strokeStyle = withAlpha(colors.dim, 0.55);
    context.lineWidth = 1.5;
    context.beginPath();
    motion.strokes.forEach((stroke) => stroke.poses.forEach(([x, y], n) =>
      context[n ? "lineTo" : "moveTo"](...this.page([x, y, ground]))));
    context.stroke();
  }

  path(context, motion) {
    context.lineWidth = 3.2;
    context.lineCap = "round";
    for (const stroke of motion.strokes) {
      context.strokeStyle = this.data.trims[stroke.trim].color;
      for (let n = 1; n < stroke.poses.length; n++) {
        const [a, b] = [stroke.poses[n - 1], stroke.poses[n]].map(([x, y, , z]) => [x, y, z]);
        context.globalAlpha = this.hidden(a) || this.hidden(b) ? HIDDEN : 1;
        line(context, this.page(a), this.page(b));
      }
    }
    context.globalAlpha = 1;
    context.lineCap = "butt";
  }

  marks(context, colors, motion) {
    context.lineWidth = 1.6;
    context.strokeStyle = colors.ink;
    const at = (pose) => this.page([pose[0], pose[1], pose[3]]);
    circle(context, at(motion.poses[0]), 4.5, colors.paper);
    context.strokeStyle = colors.goal;
    this.data.goals.forEach((goal) => circle(context, at(goal.pose), 5, colors.paper));
  }

  vehicle(context, colors, motion, time, ground, alpha) {
    const pose = motion.poseAt(time), place = [pose[0], pose[1], pose[3]];
    context.globalAlpha = alpha;
    context.strokeStyle = colors.ink;
    context.lineWidth = 1;
    context.setLineDash([3, 3]);
    line(context, this.page(place), this.page([pose[0], pose[1], ground]));
    context.setLineDash([]);
    const run = motion.runs.length ? motion.runAt(time) : null;
    context.fillStyle = run ? this.data.trims[run.trim].color : colors.dim;
    const rings = this.data.bodies.filter((one) => !one.frame).map((one) => one.ring);
    for (const ring of rings) {
      context.globalAlpha = 0.6 * alpha;
      this.face(context, colors, ring.map((corner) => [...acted(pose, corner), pose[3]]));
    }
    context.globalAlpha = alpha;
    context.lineWidth = 1.4;
    context.strokeStyle = colors.ink;
    const ahead = acted(pose, [0.06 * this.data.mark, 0]);
    line(context, this.page(place), this.page([...ahead, pose[3]]));
    circle(context, this.page(place), 4, run ? this.data.trims[run.trim].color : colors.dim);
    context.globalAlpha = 1;
  }
}

/** A colour between two "#rrggbb". */
function mixed(from, to, share) {
  const channel = (color, k) => parseInt(color.slice(1 + 2 * k, 3 + 2 * k), 16);
  const each = [0, 1, 2].map((k) => Math.round(channel(from, k) * (1 - share) + channel(to, k) * share));
  return "#" + each.map((value) => value.toString(16).padStart(2, "0")).join("");
}
