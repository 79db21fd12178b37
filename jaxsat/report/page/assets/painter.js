// A painter of polygons on a 2-D canvas, which needs no graphics card, and the view it paints.

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
