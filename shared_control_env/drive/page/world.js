// The road, the cars and the gauges on a canvas. Poses come 20 times a second and are moved on between them.

const HEIGHT = 1.35, NEAR = 0.6, FAR = 260, LONGEST = 0.15, SETTLING = 0.08, RATIO = 16;

export class World {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.top = false;
    this.road = null;
    this.frame = null;
    this.shown = [];  // shown poses: what was last drawn, and the error that fades
    this.moving = false;
    this.colours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.colours());
    const fit = () => {
      const scale = Math.min(devicePixelRatio || 1, 2);
      canvas.width = innerWidth * scale;
      canvas.height = innerHeight * scale;
      this.context.setTransform(scale, 0, 0, scale, 0, 0);
    };
    addEventListener("resize", fit);
    fit();
    const draw = () => { this.draw(performance.now() / 1000); requestAnimationFrame(draw); };
    requestAnimationFrame(draw);
  }

  colours() {
    const style = getComputedStyle(document.documentElement), known = {};
    this.colour = (name) => (known[name] ??= style.getPropertyValue(`--${name}`).trim());
  }

  setRoad(road) {
    this.road = road;
    this.frame = null;
    this.shown = [];
  }

  // A frame arrives: what is drawn goes on from where it was, and the difference fades.
  setFrame(frame, moving) {
    const now = performance.now() / 1000;
    const before = this.frame ? this.poses(now) : null;
    this.frame = frame;
    this.arrived = now;
    this.moving = moving;
    const poses = [frame.ego, ...frame.others];
    this.errors = poses.map((pose, i) => {
      const old = before && before[i];
      if (!old || Math.hypot(old[0] - pose[0], old[1] - pose[1]) > 5) return [0, 0, 0];
      return [old[0] - pose[0], old[1] - pose[1], turn(old[2] - pose[2])];
    });
  }

  // Poses at a time: each car goes on with its speed and yaw rate, for a little while.
  poses(now) {
    const since = this.moving ? Math.min(now - this.arrived, LONGEST) : 0;
    const fading = Math.exp(-(now - this.arrived) / SETTLING);
    return [this.frame.ego, ...this.frame.others].map(([x, y, psi, v, r], i) => {
      const middle = psi + 0.5 * r * since, error = this.errors[i];
      return [x + v * Math.cos(middle) * since + error[0] * fading, y + v * Math.sin(middle) * since + error[1] * fading,
        psi + r * since + error[2] * fading];
    });
  }

  draw(now) {
    const c = this.context, w = innerWidth, h = innerHeight;
    c.clearRect(0, 0, w, h);
    if (!this.road || !this.frame) { this.backdrop(w, h, 0.42 * h); return; }
    const poses = this.poses(now);
    this.last = poses;
    this.size = [w, h];
    if (this.top) this.above(poses, w, h); else this.cockpit(poses, w, h);
    this.gauges(w, h);
  }

  backdrop(w, h, horizon) {
    const c = this.context, sky = c.createLinearGradient(0, 0, 0, horizon);
    sky.addColorStop(0, this.colour("sky-high"));
    sky.addColorStop(1, this.colour("sky-low"));
    c.fillStyle = sky;
    c.fillRect(0, 0, w, horizon + 1);
    c.fillStyle = this.colour("ground");
    c.fillRect(0, horizon, w, h - horizon);
  }

  // Index of the road's point nearest to the car.
  index() {
    const { start, spacing, line } = this.road;
    return Math.max(0, Math.min(line.length - 2, Math.round((this.frame.s - start) / spacing)));
  }

  // Strip of the road between two offsets to the left of its line, as a polygon on the ground.
  strip(from, to, right, left) {
    const points = [], { line } = this.road;
    for (let i = from; i <= to; i++) points.push(at(line[i], left));
    for (let i = to; i >= from; i--) points.push(at(line[i], right));
    return points;
  }

  // Fill what is painted on the ground, by a function that projects and fills.
  surface(fill, back, ahead) {
    const { line, lanes, lane_width: width, spacing } = this.road;
    const here = this.index(), from = Math.max(0, here - back), to = Math.min(line.length - 1, here + ahead);
    const low = this.road.low, high = low + lanes * width;
    for (let i = from; i < to; i += 3) {
      const end = Math.min(i + 3, to);
      fill(this.strip(i, end, low - 0.9, high + 0.9), this.colour("road"));
    }
    const goal = this.frame.y_target, near = Math.min(here + 4, to), far = Math.min(near + 24, to);
    for (let i = near; i < far; i += 4) fill(this.strip(i, Math.min(i + 2, far), goal - 0.45, goal + 0.45), this.colour("goal"));
    for (let lane = 0; lane <= lanes; lane++) {
      const d = low + lane * width, edge = lane === 0 || lane === lanes;
      for (let i = from; i < to; i++) {
        const dash = Math.floor((i * spacing) / 6) % 2 === 0;
        if (edge || dash) fill(this.strip(i, i + 1, d - 0.08, d + 0.08), this.colour("paint"));
      }
    }
    return [from, to, low, high];
  }

  cockpit(poses, w, h) {
    const c = this.context, horizon = 0.4 * h, focal = 0.95 * Math.min(w, 1.7 * h) * 0.62;
    const [x, y, psi] = poses[0], cos = Math.cos(psi), sin = Math.sin(psi);
    this.backdrop(w, h, horizon);
    const eye = ([px, py, pz]) => {
      const dx = px - x, dy = py - y;
      return [dx * cos + dy * sin, -dx * sin + dy * cos, (pz || 0) - HEIGHT];
    };
    const screen = ([f, l, u]) => [w / 2 - (focal * l) / f, horizon - (focal * u) / f];
    const fill = (points, style) => {
      const inFront = clip(points.map(eye));
      if (inFront.length < 3) return;
      c.fillStyle = style;
      c.strokeStyle = style;
      trace(c, inFront.map(screen));
      c.fill();
      c.lineWidth = 0.7;  // closes the seams between neighbouring strips
      if (!style.startsWith("rgba")) c.stroke();
    };
    const [from, to, low, high] = this.surface(fill, 4, Math.round(FAR / this.road.spacing));
    for (let i = to - (to % 25); i > from; i -= 25) {  // posts beside the road give a feeling for the speed
      for (const d of [low - 1.6, high + 1.6]) {
        const [px, py] = at(this.road.line[i], d), foot = eye([px, py, 0]), head = eye([px, py, 0.95]);
        if (foot[0] < 1.5) continue;
        const a = screen(foot), b = screen(head), thick = Math.max(1, (0.14 * focal) / foot[0]);
        c.fillStyle = this.colour("post");
        c.fillRect(a[0] - thick / 2, b[1], thick, a[1] - b[1]);
        c.fillStyle = "#c2372e";
        c.fillRect(a[0] - thick / 2, b[1] + 0.14 * (a[1] - b[1]), thick, 0.16 * (a[1] - b[1]));
      }
    }
    const order = this.frame.others.map((other, i) => [eye(poses[i + 1])[0], i]).sort((a, b) => b[0] - a[0]);
    for (const [distance, i] of order) {
      if (distance > -4 && distance < FAR) this.car(poses[i + 1], this.frame.others[i], fill, eye);
    }
    this.bonnet(w, h);
  }

  // A car of two boxes, drawn from the far faces to the near ones.
  car([x, y, psi], other, fill, eye) {
    const length = other[5] || this.road.body[0], width = other[6] || this.road.body[1], cos = Math.cos(psi), sin = Math.sin(psi);
    const spot = (f, l, u) => [x + f * cos - l * sin, y + f * sin + l * cos, u];
    const colour = this.colour("cars"), half = length / 2, side = width / 2;
    fill([spot(half + 0.2, side + 0.2, 0.02), spot(half + 0.2, -side - 0.2, 0.02), spot(-half - 0.2, -side - 0.2, 0.02), spot(-half - 0.2, side + 0.2, 0.02)], "rgba(0,0,0,.28)");
    const box = (rear, front, low, high, inset, style, glass) => {
      const s = side - inset, slope = glass ? 0.14 * length : 0;
      const f0 = [spot(front, s, low), spot(front, -s, low), spot(front - slope, -s + inset * 0.5, high), spot(front - slope, s - inset * 0.5, high)];
      const r0 = [spot(rear, -s, low), spot(rear, s, low), spot(rear + slope * 0.7, s - inset * 0.5, high), spot(rear + slope * 0.7, -s + inset * 0.5, high)];
      const faces = [[f0, 0.9], [r0, 0.75], [[f0[0], f0[3], r0[2], r0[1]], 0.6], [[f0[1], r0[0], r0[3], f0[2]], 0.66], [[f0[3], f0[2], r0[3], r0[2]], 1.1]];
      const distance = (face) => { const e = face.map(eye); return e.reduce((sum, p) => sum + Math.hypot(...p), 0); };
      faces.sort((a, b) => distance(b[0]) - distance(a[0]));
      for (const [face, light] of faces) fill(face, shade(glass && light < 1 ? "#27323f" : style, light));
    };
    const wheels = (l) => {
      for (const f of [0.3 * length, -0.3 * length]) {
        fill([0, 1, 2, 3, 4, 5, 6, 7].map((k) => spot(f + 0.34 * Math.cos((k * Math.PI) / 4), l, 0.34 + 0.34 * Math.sin((k * Math.PI) / 4))), "#16181c");
      }
    };
    const across = -(this.last[0][0] - x) * sin + (this.last[0][1] - y) * cos;  // on which side of it the eye is
    wheels(side);
    wheels(-side);
    box(-half, half, 0.28, 0.86, 0.02, colour, false);
    if (Math.abs(across) > side) wheels(Math.sign(across) * (side + 0.01));
    const behind = eye([x - half * cos, y - half * sin, 0.7])[0] < eye([x + half * cos, y + half * sin, 0.7])[0];
    const end = behind ? -half - 0.01 : half + 0.01, lamp = behind ? "#ff3b30" : "#fff4cf";
    for (const l of [side - 0.12, -side + 0.5]) fill([spot(end, l, 0.6), spot(end, l - 0.38, 0.6), spot(end, l - 0.38, 0.76), spot(end, l, 0.76)], lamp);
    fill([spot(end, 0.26, 0.42), spot(end, -0.26, 0.42), spot(end, -0.26, 0.54), spot(end, 0.26, 0.54)], "#e9e9e4");
    box(-half * 0.72, half * 0.42, 0.86, 1.42, 0.12, colour, true);
  }

  bonnet(w, h) {
    const c = this.context, base = h - 158;
    c.fillStyle = shade(this.colour("car"), 0.82);
    c.beginPath();
    c.moveTo(0.1 * w, h);
    c.lineTo(0.1 * w, base + 60);
    c.bezierCurveTo(0.24 * w, base - 26, 0.76 * w, base - 26, 0.9 * w, base + 60);
    c.lineTo(0.9 * w, h);
    c.fill();
    c.strokeStyle = shade(this.colour("car"), 1.15);
    c.lineWidth = 2;
    c.beginPath();
    c.moveTo(0.1 * w, base + 60);
    c.bezierCurveTo(0.24 * w, base - 26, 0.76 * w, base - 26, 0.9 * w, base + 60);
    c.stroke();
  }

  above(poses, w, h) {
    const c = this.context, scale = 9, [x, y, psi] = poses[0], cos = Math.cos(psi), sin = Math.sin(psi);
    c.fillStyle = this.colour("ground");
    c.fillRect(0, 0, w, h);
    const screen = ([px, py]) => {
      const dx = px - x, dy = py - y, f = dx * cos + dy * sin, l = -dx * sin + dy * cos;
      return [w / 2 - scale * l, 0.66 * h - scale * f];
    };
    const fill = (points, style) => {
      c.fillStyle = c.strokeStyle = style;
      trace(c, points.map(screen));
      c.fill();
      c.lineWidth = 0.7;
      if (!style.startsWith("rgba")) c.stroke();
    };
    this.surface(fill, Math.ceil((0.5 * h) / scale / this.road.spacing), Math.ceil(h / scale / this.road.spacing) + 4);
    poses.forEach((pose, i) => this.plan(pose, i ? this.frame.others[i - 1] : null, fill));
  }

  plan([x, y, psi], other, fill) {
    const [length, width] = other ? other.slice(5) : this.road.body, cos = Math.cos(psi), sin = Math.sin(psi);
    const colour = this.colour(other ? "cars" : "car"), a = length / 2, b = width / 2;
    const shape = (points) => points.map(([f, l]) => [x + f * cos - l * sin, y + f * sin + l * cos]);
    fill(shape([[a - 0.5, b], [a, b - 0.5], [a, -b + 0.5], [a - 0.5, -b], [-a + 0.3, -b], [-a, -b + 0.3], [-a, b - 0.3], [-a + 0.3, b]]), colour);
    fill(shape([[0.42 * a, b - 0.25], [0.42 * a, -b + 0.25], [0.15 * a, -b + 0.35], [0.15 * a, b - 0.35]]), "#27323f");
    fill(shape([[-0.5 * a, b - 0.35], [-0.5 * a, -b + 0.35], [-0.72 * a, -b + 0.25], [-0.72 * a, b - 0.25]]), "#27323f");
    for (const l of [b - 0.55, -b + 0.1]) fill(shape([[-a, l], [-a, l + 0.45], [-a + 0.15, l + 0.45], [-a + 0.15, l]]), "#ff3b30");
  }

  gauges(w, h) {
    const c = this.context, f = this.frame, [aMax, deltaMax] = this.road.limits, top = h - 132;
    c.fillStyle = this.colour("paper");
    c.fillRect(0, top, w, 132);
    c.fillStyle = this.colour("line");
    c.fillRect(0, top, w, 1);
    c.textBaseline = "alphabetic";
    // Speed.
    const speed = f.ego[3];
    this.text(speed.toFixed(1), 28, top + 64, "600 46px system-ui", "ink");
    this.text("m/s", 36 + c.measureText(speed.toFixed(1)).width, top + 64, "16px system-ui", "faint");
    this.text(`${(3.6 * speed).toFixed(0)} km/h    wanted ${f.v_target.toFixed(1)} m/s`, 30, top + 92, "14px system-ui", "faint");
    this.text(`t ${f.t.toFixed(1)} of ${this.road.duration.toFixed(0)} s    lane error ${(f.d - f.y_target).toFixed(2)} m`, 30, top + 114, "14px system-ui", "faint");
    // Wheel: the person's angle, and the automation's as a mark on the rim.
    const x = w / 2, y = top + 66, r = 52;
    this.wheel = mix(this.wheel, f.wheel[1]);
    c.save();
    c.translate(x, y);
    if (f.automation) {
      c.save();
      c.rotate(-RATIO * f.automation[1]);
      c.fillStyle = this.colour("automation");
      c.beginPath();
      c.moveTo(0, -r - 3);
      c.lineTo(-8, -r - 15);
      c.lineTo(8, -r - 15);
      c.fill();
      c.restore();
    }
    c.rotate(-RATIO * this.wheel);
    c.strokeStyle = this.colour("person");
    c.lineWidth = 9;
    c.beginPath();
    c.arc(0, 0, r, 0, 2 * Math.PI);
    c.stroke();
    c.lineWidth = 7;
    c.beginPath();
    c.moveTo(-r, 0);
    c.lineTo(r, 0);
    c.moveTo(0, 0);
    c.lineTo(0, r);
    c.stroke();
    c.restore();
    // Pedals.
    const push = f.wheel[0] / aMax;
    this.bar(x - 150, top + 22, 14, 84, Math.max(0, -push), "warn", "brake");
    this.bar(x + 136, top + 22, 14, 84, Math.max(0, push), "person", "drive");
    // Authority, risk and fault, as far as they are shown.
    const left = Math.max(w / 2 + 200, w - 400), span = w - left - 30;
    let row = top + 28;
    const line = (label, value, colour) => {
      this.text(label, left, row, "13px system-ui", "faint");
      this.text(value.toFixed(2), left + span, row, "13px system-ui", "ink", "right");
      c.fillStyle = this.colour("track");
      c.fillRect(left, row + 5, span, 7);
      c.fillStyle = this.colour(colour);
      c.fillRect(left, row + 5, span * Math.max(0, Math.min(1, value)), 7);
      row += 30;
    };
    if (f.alpha) line("authority of the automation, \u03b1\u2090", Math.min(...f.alpha), "authority");
    if (f.risk) { line("lateral risk r_y", f.risk[1], "risk"); line("longitudinal risk r_x", f.risk[0], "risk"); }
    if (f.fault !== undefined) this.text(f.fault ? "\u25cf automation degraded" : "\u25cb no fault so far", left, row + 4, "600 13px system-ui", f.fault ? "warn" : "faint");
    if (f.alert) this.text("\u26a0 take over", x, top - 16, "600 26px system-ui", "warn", "center");
    c.textAlign = "left";
  }

  text(text, x, y, font, colour, align = "left") {
    const c = this.context;
    c.font = font.replace("system-ui", "system-ui, sans-serif");
    c.fillStyle = this.colour(colour);
    c.textAlign = align;
    c.fillText(text, x, y);
  }

  bar(x, y, width, height, share, colour, label) {
    const c = this.context;
    c.fillStyle = this.colour("track");
    c.fillRect(x, y, width, height);
    c.fillStyle = this.colour(colour);
    c.fillRect(x, y + height * (1 - share), width, height * share);
    this.text(label, x + width / 2, y + height + 15, "12px system-ui", "faint", "center");
    c.textAlign = "left";
  }
}

const at = ([x, y, psi], d) => [x - d * Math.sin(psi), y + d * Math.cos(psi), 0];
const turn = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
const mix = (old, value) => (old === undefined ? value : old + 0.35 * (value - old));

// The part of a polygon in front of the eye.
function clip(points) {
  const kept = [];
  points.forEach((p, i) => {
    const q = points[(i + 1) % points.length];
    if (p[0] >= NEAR) kept.push(p);
    if (p[0] >= NEAR !== q[0] >= NEAR) {
      const t = (NEAR - p[0]) / (q[0] - p[0]);
      kept.push(p.map((value, k) => value + t * (q[k] - value)));
    }
  });
  return kept;
}

function trace(c, points) {
  c.beginPath();
  points.forEach(([x, y], i) => (i ? c.lineTo(x, y) : c.moveTo(x, y)));
  c.closePath();
}

function shade(hex, light) {
  const value = parseInt(hex.slice(1), 16);
  const part = (shift) => Math.min(255, Math.round(((value >> shift) & 255) * light));
  return `rgb(${part(16)}, ${part(8)}, ${part(0)})`;
}
