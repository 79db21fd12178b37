// One spacecraft on its canvas.
class Craft {
  constructor(data, camera) {
    this.data = data;
    this.camera = camera;
    this.time = decoded(data.time, Float64Array);
    this.quaternion = decoded(data.quaternion, Float64Array);
    this.error = decoded(data.error, Float32Array);
    this.torque = decoded(data.torque, Float32Array);
    this.levels = decoded(data.levels, Float32Array);
    this.devices = data.devices.map((one) => ({ ...one, levels: decoded(one.levels, Float32Array) }));
    this.size = Math.max(...data.half);
    this.extent = 1.85 * this.size;
  }

  get start() { return this.time[0]; }

  get end() { return this.time[this.time.length - 1]; }

  // The last sample at or before a time, and the part of the way to the next.
  place(time) {
    let low = 0;
    let high = this.time.length - 1;
    if (time >= this.time[high]) return [high, 0];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= time) low = middle; else high = middle;
    }
    const step = this.time[low + 1] - this.time[low];
    return [low, Math.max(0, (time - this.time[low]) / step)];
  }

  attitude(time) {
    const [low, part] = this.place(time);
    const at = (place) => Array.from(this.quaternion.subarray(4 * place, 4 * place + 4));
    return part === 0 ? at(low) : slerp(at(low), at(low + 1), part);
  }

  // A row of an array over time: held from each sample to the next, or on a straight line.
  row(values, count, time, straight) {
    const [low, part] = this.place(time);
    const here = values.subarray(count * low, count * (low + 1));
    if (!straight || part === 0) return here;
    return here.map((value, place) => value + part * (values[count * (low + 1) + place] - value));
  }

  phase(time) {
    return this.data.phases.find((one) => one.start <= time && time < one.end)
      || this.data.phases.at(-1) || null;
  }

  draw(canvas, time, colors) {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const painter = new Painter(canvas.getContext("2d"), this.camera.frame(width, height, this.extent));
    painter.clear(ratio, width, height, colors.paper);
    const axes = bodyAxes(this.attitude(time));
    const turned = (p) => sum(scale(axes[0], p[0]), scale(axes[1], p[1]), scale(axes[2], p[2]));
    this.drawFrame(painter, colors);
    if (this.data.target) this.drawTarget(painter, colors);
    this.drawBody(painter, turned, colors);
    this.drawThrusters(painter, turned, time, colors);
    this.devices.forEach((one) => {
      if (one.shape === "disc") this.drawDiscs(painter, turned, time, colors, one);
      else this.drawRods(painter, turned, time, colors, one);
    });
    ["x", "y", "z"].forEach((name, place) => {
      const tip = scale(axes[place], 1.5 * this.size);
      painter.arrow(scale(axes[place], 0.2 * this.size), tip, colors.axes[place], 2);
      painter.label(scale(tip, 1.06), name, colors.axes[place]);
    });
    painter.finish(colors);
  }

  drawFrame(painter, colors) {
    ["x, velocity", "y", "z, to the Earth"].forEach((name, place) => {
      const tip = [0, 1, 2].map((other) => (other === place ? 1.7 * this.size : 0));
      painter.arrow([0, 0, 0], tip, colors.quiet, 1);
      painter.label(scale(tip, 1.04), name, colors.quiet);
    });
  }

  corners() {
    const { half, axes } = this.data;
    return [0, 1, 2, 3, 4, 5, 6, 7].map((number) => sum(
      ...[0, 1, 2].map((side) => scale(axes[side], half[side] * (number & (1 << side) ? 1 : -1))),
    ));
  }

  drawTarget(painter, colors) {
    const corners = this.corners();
    for (let one = 0; one < 8; one += 1) {
      for (const bit of [1, 2, 4]) {
        if (!(one & bit)) painter.line([corners[one], corners[one | bit]], colors.target, 1, [4, 4]);
      }
    }
  }

  drawBody(painter, turned, colors) {
    const corners = this.corners().map(turned);
    const inside = this.devices.length || this.data.thrusters.some((one) => one.position);
    const seen = inside ? 0.45 : 0.94; // parts inside or behind are seen through it
    [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]].forEach((face) => {
      painter.polygon(face.map((place) => corners[place]), colors.body, colors.edge, seen);
    });
  }

  // The last failure of a part at a time, which replaces those before it.
  failedAt(part, time) {
    return part.failures.filter((one) => time >= one.at).pop();
  }

  drawThrusters(painter, turned, time, colors) {
    const { thrusters } = this.data;
    const levels = this.levels ? this.row(this.levels, this.levels.length / this.time.length, time) : null;
    const torque = this.row(this.torque, 3, time);
    for (const one of thrusters) {
      const failed = this.failedAt(one, time);
      const level = levels && one.column !== null ? levels[one.column] : null;
      if (one.position && one.force) this.drawNozzle(painter, turned, one, level, failed, colors);
      else if (one.axis) {
        const along = level === null ? dot(one.axis, Array.from(torque)) : level;
        const gone = failed && ["dead", "failed"].includes(failed.kind);
        this.drawTorque(painter, turned, one, gone ? 0 : along, failed, colors);
      }
    }
  }

  drawNozzle(painter, turned, one, level, failed, colors) {
    const size = 0.13 * this.size;
    const out = scale(one.force, -1); // the gas leaves against the force
    const mouth = add(one.position, scale(out, 1.5 * size));
    const rim = circle(mouth, out, 0.62 * size, 8).map(turned);
    const throat = turned(one.position);
    for (let place = 0; place < 8; place += 1) {
      painter.polygon([throat, rim[place], rim[place + 1]], colors.part, failed ? colors.failed : colors.edge, 1);
    }
    if (level > 0.001) {
      const shown = Math.sqrt(Math.min(1, level)); // short pulses would not be seen
      const end = turned(add(mouth, scale(out, size * (1 + 5 * shown))));
      const base = circle(mouth, out, size * (0.45 + 0.3 * shown), 8).map(turned);
      for (let place = 0; place < 8; place += 1) {
        painter.polygon([end, base[place], base[place + 1]], colors.plume, null, 0.45 + 0.3 * shown);
      }
    }
    this.mark(painter, turned(add(mouth, scale(out, 2 * size))), one.name, failed, colors);
  }

  // A torque without a place: an arc about its axis, as long as the torque is large.
  drawTorque(painter, turned, one, level, failed, colors) {
    const [near, far] = [0.7, 1.2].map((reach) => scale(one.axis, reach * this.size));
    painter.line([turned(near), turned(far)], failed ? colors.failed : colors.quiet, 3, failed ? [3, 4] : []);
    if (Math.abs(level) > 0.01) {
      const arc = circle(scale(one.axis, 1.08 * this.size), one.axis, 0.3 * this.size, 24, 0, 5 * level);
      painter.line(arc.map(turned), colors.plume, 3);
      painter.head(turned(arc[23]), turned(arc[24]), colors.plume);
    }
    this.mark(painter, turned(scale(one.axis, 1.3 * this.size)), one.name, failed, colors);
  }

  // A disc in the body's side, such as a wheel, and an arrow as long as its momentum is of its limit.
  drawDiscs(painter, turned, time, colors, { parts, levels }) {
    const momenta = levels ? this.row(levels, parts.length, time, true) : null;
    parts.forEach((one, place) => {
      const failed = this.failedAt(one, time);
      const centre = scale(one.axis, 0.5 * this.size);
      const disc = circle(centre, one.axis, 0.3 * this.size, 24).map(turned);
      painter.polygon(disc, colors.wheel, failed ? colors.failed : colors.edge, 0.9);
      const level = momenta ? momenta[place] : 0;
      if (Math.abs(level) > 1e-3) {
        const tip = add(centre, scale(one.axis, 1.1 * this.size * Math.max(-1, Math.min(1, level))));
        painter.arrow(turned(centre), turned(tip), colors.plume, 4);
      }
      this.mark(painter, turned(scale(one.axis, 0.62 * this.size)), one.name, failed, colors);
    });
  }

  // A rod through the body, such as a magnetorquer, and an arrow as long as its dipole is of its limit.
  drawRods(painter, turned, time, colors, { parts, levels }) {
    const dipoles = levels ? this.row(levels, parts.length, time) : null;
    parts.forEach((one, place) => {
      const failed = this.failedAt(one, time);
      const [back, front] = [-0.55, 0.55].map((reach) => scale(one.axis, reach * this.size));
      painter.line([turned(back), turned(front)], failed ? colors.failed : colors.edge, 5, failed ? [3, 4] : []);
      const level = dipoles ? Math.max(-1, Math.min(1, dipoles[place])) : 0;
      if (Math.abs(level) > 0.01) painter.arrow([0, 0, 0], turned(scale(one.axis, 0.9 * level * this.size)), colors.plume, 3);
      this.mark(painter, turned(scale(one.axis, 0.66 * this.size)), one.name, failed, colors);
    });
  }

  mark(painter, place, name, failed, colors) {
    painter.label(place, failed ? `✕ ${name}` : name, failed ? colors.failed : colors.ink, failed);
  }

  // What the picture shows, in words.
  told(time) {
    const parts = [];
    const failed = [...this.data.thrusters.map((one) => ["thruster", one]),
      ...this.devices.flatMap(({ kind, parts: all }) => all.map((one) => [kind, one]))]
      .filter(([, one]) => this.failedAt(one, time))
      .map(([what, one]) => `${what} ${one.name}: ${this.failedAt(one, time).kind}`);
    const [place, part] = this.place(time);
    const next = this.error[Math.min(place + 1, this.error.length - 1)];
    parts.push(`pointing error ${(this.error[place] + part * (next - this.error[place])).toPrecision(3)}°`);
    const phase = this.phase(time);
    if (phase) parts.push(`phase: ${phase.name}`);
    return { text: parts.join(" · "), failed: [...new Set(failed)].join(", ") };
  }
}
