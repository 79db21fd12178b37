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
