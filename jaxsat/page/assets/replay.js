// The 3-D replay: a painter of polygons on a 2-D canvas, which needs no graphics card.
// Vectors are arrays of three; body vectors are turned into the orbit frame by the attitude.

const COLORS = {
  light: {
    paper: "#f5f6f8", ink: "#1a1a1a", quiet: "#5f6670", body: [205, 214, 226], edge: "#39424e",
    target: "#0b57a4", plume: "#D55E00", failed: "#b00020", axes: ["#000000", "#D55E00", "#2b7fb5"],
    part: [150, 158, 168], wheel: [125, 150, 180],
  },
  dark: {
    paper: "#1f242b", ink: "#e8e8e8", quiet: "#a4abb5", body: [92, 106, 124], edge: "#cfd6df",
    target: "#8cc4ff", plume: "#ff9a4d", failed: "#ff6b81", axes: ["#ffffff", "#ff9a4d", "#6fc3f2"],
    part: [140, 150, 162], wheel: [110, 150, 195],
  },
};

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];
const unit = (a) => scale(a, 1 / (Math.hypot(...a) || 1));
const sum = (...vectors) => vectors.reduce(add);

function decoded(text, Kind) {
  if (text === null) return null;
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Spherical linear interpolation between unit quaternions, the shorter way round.
function slerp(from, to, part) {
  let cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2] + from[3] * to[3];
  const sign = cosine < 0 ? -1 : 1;
  cosine = Math.min(1, Math.abs(cosine));
  const angle = Math.acos(cosine);
  let first = 1 - part;
  let second = part;
  if (angle > 1e-6) {
    first = Math.sin((1 - part) * angle) / Math.sin(angle);
    second = Math.sin(part * angle) / Math.sin(angle);
  }
  const mixed = from.map((value, place) => first * value + sign * second * to[place]);
  const length = Math.hypot(...mixed);
  return mixed.map((value) => value / length);
}

// Columns of the matrix that turns body into orbit components, C(q) transposed.
function bodyAxes([q0, q1, q2, q3]) {
  return [
    [1 - 2 * (q2 * q2 + q3 * q3), 2 * (q1 * q2 + q0 * q3), 2 * (q1 * q3 - q0 * q2)],
    [2 * (q1 * q2 - q0 * q3), 1 - 2 * (q1 * q1 + q3 * q3), 2 * (q2 * q3 + q0 * q1)],
    [2 * (q1 * q3 + q0 * q2), 2 * (q2 * q3 - q0 * q1), 1 - 2 * (q1 * q1 + q2 * q2)],
  ];
}

// Two unit vectors across a direction.
function across(direction) {
  const least = direction.map(Math.abs).indexOf(Math.min(...direction.map(Math.abs)));
  const first = unit(cross(direction, [0, 1, 2].map((place) => Number(place === least))));
  return [first, cross(direction, first)];
}

function circle(centre, direction, radius, count, from = 0, sweep = 2 * Math.PI) {
  const [first, second] = across(direction);
  return Array.from({ length: count + 1 }, (_, place) => {
    const angle = from + (sweep * place) / count;
    return sum(centre, scale(first, radius * Math.cos(angle)), scale(second, radius * Math.sin(angle)));
  });
}

// A view of the orbit frame; the Earth (z) is below.
class Camera {
  constructor() {
    this.turn = -0.9;
    this.rise = 0.42;
    this.zoom = 1;
  }

  frame(width, height, extent) {
    const [c, s] = [Math.cos(this.turn), Math.sin(this.turn)];
    const [u, v] = [Math.cos(this.rise), Math.sin(this.rise)];
    const towards = [c * u, s * u, -v]; // from the origin to the eye
    const right = [-s, c, 0].map((value) => -value);
    const up = cross(towards, right);
    const size = (this.zoom * Math.min(0.8 * width, height)) / (2 * extent);
    return {
      towards,
      point: (p) => [width / 2 + size * dot(p, right), height / 2 - size * dot(p, up), dot(p, towards)],
    };
  }
}

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
    this.momentum = decoded(data.momentum, Float32Array);
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
    this.drawWheels(painter, turned, time, colors);
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
    const seen = this.data.wheels.length ? 0.42 : 0.94;
    [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]].forEach((face) => {
      painter.polygon(face.map((place) => corners[place]), colors.body, colors.edge, seen);
    });
  }

  failedAt(part, time) {
    return part.failed !== null && time >= part.failed;
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
        this.drawTorque(painter, turned, one, failed ? 0 : along, failed, colors);
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
    this.mark(painter, turned(add(mouth, scale(out, 0.5 * size))), one.name, failed, colors);
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

  drawWheels(painter, turned, time, colors) {
    const { wheels } = this.data;
    const momentum = this.momentum ? this.row(this.momentum, wheels.length, time, true) : null;
    wheels.forEach((one, place) => {
      const failed = this.failedAt(one, time);
      const centre = scale(one.axis, 0.5 * this.size);
      const disc = circle(centre, one.axis, 0.3 * this.size, 24).map(turned);
      painter.polygon(disc, colors.wheel, failed ? colors.failed : colors.edge, 0.9);
      const level = momentum ? momentum[place] : 0;
      if (Math.abs(level) > 1e-3) {
        const tip = add(centre, scale(one.axis, 1.1 * this.size * Math.max(-1, Math.min(1, level))));
        painter.arrow(turned(centre), turned(tip), colors.plume, 4);
      }
      this.mark(painter, turned(scale(one.axis, 0.62 * this.size)), one.name, failed, colors);
    });
  }

  mark(painter, place, name, failed, colors) {
    painter.label(place, failed ? `✕ ${name}` : name, failed ? colors.failed : colors.ink, failed);
  }

  // What the picture shows, in words.
  told(time) {
    const parts = [];
    const failed = [...this.data.thrusters.map((one) => ["thruster", one]),
      ...this.data.wheels.map((one) => ["wheel", one])]
      .filter(([, one]) => this.failedAt(one, time))
      .map(([what, one]) => `${what} ${one.name}: ${one.kind}`);
    const [place, part] = this.place(time);
    const next = this.error[Math.min(place + 1, this.error.length - 1)];
    parts.push(`pointing error ${(this.error[place] + part * (next - this.error[place])).toPrecision(3)}°`);
    const phase = this.phase(time);
    if (phase) parts.push(`phase: ${phase.name}`);
    return { text: parts.join(" · "), failed: [...new Set(failed)].join(", ") };
  }
}

// Polygons and lines from far to near; labels on top.
class Painter {
  constructor(context, view) {
    this.context = context;
    this.view = view;
    this.things = [];
    this.labels = [];
  }

  clear(ratio, width, height, paper) {
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.context.fillStyle = paper;
    this.context.fillRect(0, 0, width, height);
    this.context.lineJoin = "round";
  }

  polygon(points, fill, edge, opacity) {
    const normal = unit(cross(
      add(points[1], scale(points[0], -1)), add(points[2], scale(points[0], -1)),
    ));
    const light = 0.72 + 0.28 * Math.abs(dot(normal, this.view.towards));
    const color = typeof fill === "string" ? fill : `rgb(${fill.map((value) => Math.round(value * light)).join(" ")})`;
    this.keep(points, (context) => {
      context.closePath();
      context.globalAlpha = opacity;
      context.fillStyle = color;
      context.fill();
      context.globalAlpha = Math.min(1, opacity + 0.4);
      if (edge) this.stroke(edge, 1, []);
      context.globalAlpha = 1;
    });
  }

  line(points, color, width, dash = []) {
    this.keep(points, () => this.stroke(color, width, dash));
  }

  stroke(color, width, dash) {
    this.context.strokeStyle = color;
    this.context.lineWidth = width;
    this.context.setLineDash(dash);
    this.context.stroke();
  }

  arrow(from, to, color, width) {
    this.line([from, to], color, width);
    this.head(from, to, color);
  }

  head(from, to, color) {
    const [a, b] = [this.view.point(from), this.view.point(to)];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (length < 4) return;
    const [x, y] = [(b[0] - a[0]) / length, (b[1] - a[1]) / length];
    this.things.push([b[2], (context) => {
      context.beginPath();
      context.moveTo(b[0] + 3 * x, b[1] + 3 * y);
      context.lineTo(b[0] - 7 * x - 4 * y, b[1] - 7 * y + 4 * x);
      context.lineTo(b[0] - 7 * x + 4 * y, b[1] - 7 * y - 4 * x);
      context.closePath();
      context.fillStyle = color;
      context.fill();
    }]);
  }

  label(place, text, color, strong = false) {
    this.labels.push([this.view.point(place), text, color, strong]);
  }

  keep(points, paint) {
    const seen = points.map(this.view.point);
    const depth = seen.reduce((total, point) => total + point[2], 0) / seen.length;
    this.things.push([depth, (context) => {
      context.beginPath();
      seen.forEach(([x, y], place) => (place ? context.lineTo(x, y) : context.moveTo(x, y)));
      paint(context);
    }]);
  }

  finish(colors) {
    this.things.sort((one, other) => one[0] - other[0]);
    for (const [, paint] of this.things) paint(this.context);
    const { context } = this;
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const [[x, y], text, color, strong] of this.labels) {
      context.font = `${strong ? "bold " : ""}12px system-ui, "DejaVu Sans", sans-serif`;
      context.setLineDash([]);
      context.lineWidth = 4;
      context.strokeStyle = colors.paper;
      context.strokeText(text, x, y);
      context.fillStyle = color;
      context.fillText(text, x, y);
    }
  }
}

// Spacecraft side by side, one time for all of them, and what moves it.
class Replay {
  constructor(place) {
    this.place = place;
    this.section = place.dataset.section;
    this.camera = new Camera();
    const data = JSON.parse(document.getElementById(place.dataset.source).textContent);
    this.crafts = data.map((one) => new Craft(one, this.camera));
    this.start = Math.min(...this.crafts.map((one) => one.start));
    this.end = Math.max(...this.crafts.map((one) => one.end));
    this.limits = [this.start, this.end];
    this.time = this.start;
    this.playing = false;
    this.build();
  }

  build() {
    const make = (name, settings = {}, ...inside) => {
      const made = Object.assign(document.createElement(name), settings);
      made.append(...inside);
      return made;
    };
    const stages = make("div", { className: `stages${this.crafts.length === 1 ? " alone" : ""}` });
    this.stages = this.crafts.map((one) => {
      const canvas = make("canvas", { tabIndex: 0 });
      canvas.setAttribute("role", "img");
      const told = make("div", { className: "told" });
      const stage = make("div", { className: "stage" }, canvas, told);
      stages.append(stage);
      this.follow(canvas);
      return { canvas, told, stage, craft: one };
    });
    this.button = make("button", { type: "button", textContent: "▶ Play" });
    this.button.addEventListener("click", () => this.play(!this.playing));
    this.slider = make("input", {
      type: "range", min: this.start, max: this.end, step: "any", value: this.start,
    });
    this.slider.setAttribute("aria-label", "Time of the replay");
    this.slider.addEventListener("input", () => this.show(Number(this.slider.value)));
    this.slider.addEventListener("keydown", (event) => this.step(event));
    this.clock = make("output", { className: "clock" });
    this.speed = make("select", {}, ...[1, 2, 5, 10, 20, 50, 100].map(
      (value) => make("option", { value, textContent: `${value} ×`, selected: value === 10 }),
    ));
    const bar = make("div", { className: "bar" }, this.button, this.slider, this.clock,
      make("label", {}, "speed ", this.speed));
    const phases = this.crafts.length === 1 ? this.crafts[0].data.phases : [];
    const spans = [["whole run", this.start, this.end],
      ...phases.map((one, number) => [`${number + 1}: ${one.name}`, one.start, one.end])];
    if (spans.length > 1) {
      this.spans = make("select", {}, ...spans.map(([name], value) => make("option", { value, textContent: name })));
      this.spans.addEventListener("change", () => this.take(spans[Number(this.spans.value)]));
      bar.append(make("label", {}, "follow ", this.spans));
    }
    const reset = make("button", { type: "button", textContent: "Reset view" });
    reset.addEventListener("click", () => { Object.assign(this.camera, new Camera()); this.paint(); });
    bar.append(reset);
    const note = make("p", { className: "quiet" }, "In the orbit frame (grey arrows). The dashed box is "
      + "the target attitude. Drag to turn the view, or use the arrow keys, + and −. Box scaled by inertia.");
    this.place.append(stages, bar, note);
    new ResizeObserver(() => this.paint()).observe(this.place);
  }

  // Dragging and keys turn the view.
  follow(canvas) {
    const turn = (right, up) => {
      this.camera.turn += right;
      this.camera.rise = Math.max(-1.5, Math.min(1.5, this.camera.rise + up));
      this.paint();
    };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(0.008 * event.movementX, 0.008 * event.movementY);
    });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      const zooms = { "+": 1.15, "-": 1 / 1.15 };
      if (event.key in turns) turn(...turns[event.key]);
      else if (event.key in zooms) { this.camera.zoom *= zooms[event.key]; this.paint(); }
      else if (event.key === " ") this.play(!this.playing);
      else return;
      event.preventDefault();
    });
  }

  // Keys move the slider by a hundredth of its range.
  step(event) {
    const moves = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
    if (!(event.key in moves)) return;
    event.preventDefault();
    this.show(this.time + (moves[event.key] * (this.limits[1] - this.limits[0])) / 100);
  }

  take([, low, high]) {
    this.limits = [low, high];
    this.slider.min = low;
    this.slider.max = high;
    showWindow(this.section, low, high);
    this.show(low);
  }

  play(on) {
    this.playing = on;
    this.button.textContent = on ? "❚❚ Pause" : "▶ Play";
    if (!on) return;
    if (this.time >= this.limits[1]) this.time = this.limits[0];
    let last = null;
    const frame = (now) => {
      if (!this.playing) return;
      if (last !== null) this.show(this.time + (Number(this.speed.value) * (now - last)) / 1000);
      last = now;
      if (this.time >= this.limits[1]) this.play(false);
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  show(time) {
    this.time = Math.min(Math.max(time, this.limits[0]), this.limits[1]);
    this.slider.value = this.time;
    const told = `${this.time.toFixed(this.end - this.start > 100 ? 1 : 2)} s`;
    this.clock.value = told;
    this.slider.setAttribute("aria-valuetext", told);
    for (const { canvas, told: words, stage, craft } of this.stages) {
      const { text, failed } = craft.told(this.time);
      const title = this.stages.length > 1 ? `${craft.data.title}: ` : "";
      words.replaceChildren(title + text);
      if (failed) {
        const strong = document.createElement("strong");
        strong.textContent = ` · failed: ${failed}`;
        words.append(strong);
      }
      canvas.setAttribute("aria-label", `Spacecraft ${craft.data.title} at ${told}, ${text}`);
      stage.dataset.quaternion = JSON.stringify(craft.attitude(this.time));
      stage.dataset.axes = JSON.stringify(bodyAxes(craft.attitude(this.time)));
    }
    showCursor(this.section, this.time);
    this.paint();
  }

  paint() {
    const dark = matchMedia("(prefers-color-scheme: dark)").matches && !matchMedia("print").matches;
    for (const { canvas, craft } of this.stages) {
      if (canvas.clientWidth) craft.draw(canvas, this.time, dark ? COLORS.dark : COLORS.light);
    }
  }
}
