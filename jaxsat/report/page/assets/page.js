// Everything but the replays: colours of the plots, time windows, tables, saving.

const told = JSON.parse(document.getElementById("told").textContent);
const INKS = {
  light: { line: "#000000", text: "#1a1a1a", axis: "#555555", grid: "#dddddd" },
  dark: { line: "#f0f0f0", text: "#e8e8e8", axis: "#b4b9c1", grid: "#3a4049" },
};

function plots() {
  return typeof Bokeh === "undefined" ? null : Bokeh.documents[0] || null;
}

function model(id) {
  const found = plots();
  return found ? found.get_model_by_id(id) : null;
}

// Lines, texts and grids of the plots in the colours of the page.
function paintPlots(dark) {
  const ink = dark ? INKS.dark : INKS.light;
  const settings = {
    "ink": (one) => one.type.endsWith("Axis")
      ? { axis_line_color: ink.axis, major_tick_line_color: ink.axis, minor_tick_line_color: null }
      : { line_color: ink.line },
    "ink-text": () => ({ axis_label_text_color: ink.text, major_label_text_color: ink.text }),
    "ink-grid": () => ({ grid_line_color: ink.grid }),
    "ink-fill": () => ({ fill_color: ink.line }),
  };
  for (const [tag, ids] of Object.entries(told.inks)) {
    for (const id of ids) {
      const one = model(id);
      if (one) one.setv(settings[tag](one));
    }
  }
}

// Bokeh takes colours over and paints in later frames; the browser prints before them.
function finishPlots() {
  if (plots() === null) return;
  for (const view of Bokeh.index.roots) {
    for (const one of view.computed_renderer_views ?? []) {
      one.glyph?.set_visuals(one.model.data_source, one.all_indices);
    }
    view.repaint?.();
  }
}

const darkMode = matchMedia("(prefers-color-scheme: dark)");
const printing = matchMedia("print");

function repaint() {
  const dark = darkMode.matches && !printing.matches;
  paintPlots(dark);
  if (printing.matches) finishPlots();
  for (const replay of replays) replay.paint();
}

// The window of time that all plots of a section show.
class TimeWindow {
  constructor(form, settings) {
    this.form = form;
    this.settings = settings;
    this.range = model(settings.range);
    for (const name of ["from", "to"]) {
      form.elements[name].addEventListener("change", () => this.take());
    }
    const moves = {
      earlier: ([low, high]) => [low - (high - low) / 2, high - (high - low) / 2],
      later: ([low, high]) => [low + (high - low) / 2, high + (high - low) / 2],
      closer: ([low, high]) => [low + (high - low) / 4, high - (high - low) / 4],
      wider: ([low, high]) => [low - (high - low) / 2, high + (high - low) / 2],
      whole: () => [settings.start, settings.end],
    };
    for (const [name, move] of Object.entries(moves)) {
      form.elements[name].addEventListener("click", () => this.show(...move(this.shown())));
    }
    form.addEventListener("submit", (event) => event.preventDefault());
    for (const end of ["start", "end"]) this.range.properties[end].change.connect(() => this.tell());
    this.tell();
  }

  shown() {
    return [this.range.start, this.range.end];
  }

  show(low, high) {
    const { start, end } = this.settings;
    const width = Math.min(Math.max(high - low, (end - start) * 1e-6), end - start);
    const begin = Math.min(Math.max(low, start), end - width);
    this.range.setv({ start: begin, end: begin + width });
  }

  take() {
    const low = Number(this.form.elements.from.value);
    const high = Number(this.form.elements.to.value);
    if (Number.isFinite(low) && Number.isFinite(high) && high > low) this.show(low, high);
    else this.tell();
  }

  tell() {
    const [low, high] = this.shown();
    this.form.elements.from.value = Number(low.toPrecision(7));
    this.form.elements.to.value = Number(high.toPrecision(7));
  }
}

const windows = new Map();

function connectPlots() {
  for (const form of document.querySelectorAll("form.window")) {
    const settings = told.windows[Number(form.dataset.section)];
    if (settings) windows.set(form.dataset.section, new TimeWindow(form, settings));
  }
  for (const section of document.querySelectorAll("section.result")) {
    const shown = windows.get(section.id.slice(1));
    if (!shown) continue;
    for (const plot of section.querySelectorAll(".plot")) {
      plot.addEventListener("dblclick", () => shown.show(shown.settings.start, shown.settings.end));
    }
  }
}

// The replay of a section moves the cursor of its plots.
function showCursor(section, time) {
  const settings = told.windows[Number(section)];
  const cursor = settings ? model(settings.cursor) : null;
  if (cursor) cursor.setv({ location: time });
}

function showWindow(section, low, high) {
  const shown = windows.get(section);
  if (shown) shown.show(low, high);
}

function sortTable(table, column, button) {
  const head = button.closest("th");
  const up = head.getAttribute("aria-sort") !== "ascending";
  for (const other of head.parentElement.children) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", up ? "ascending" : "descending");
  const key = (row) => {
    const cell = row.cells[column];
    return "value" in cell.dataset ? cell.dataset.value : cell.textContent.trim();
  };
  const number = (text) => (text === "inf" ? Infinity : text === "-inf" ? -Infinity
    : text === "" || text === "nan" ? NaN : Number(text));
  const rows = [...table.tBodies[0].rows].map((row) => ({ row, text: key(row), value: number(key(row)) }));
  const numeric = rows.some((one) => !Number.isNaN(one.value));
  rows.sort((one, other) => {
    if (!numeric) return (up ? 1 : -1) * one.text.localeCompare(other.text);
    if (Number.isNaN(one.value) || Number.isNaN(other.value)) {
      return Number(Number.isNaN(one.value)) - Number(Number.isNaN(other.value));
    }
    if (one.value === other.value) return 0;
    return (up ? 1 : -1) * (one.value < other.value ? -1 : 1);
  });
  table.tBodies[0].append(...rows.map((one) => one.row));
}

for (const table of document.querySelectorAll("table.sortable")) {
  table.querySelectorAll("th button").forEach((button, column) => {
    button.addEventListener("click", () => sortTable(table, column, button));
  });
}

for (const button of document.querySelectorAll("button.save")) {
  button.addEventListener("click", () => {
    const text = document.getElementById(button.dataset.from).textContent;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
    link.download = button.dataset.file;
    link.click();
    URL.revokeObjectURL(link.href);
  });
}

const replays = [...document.querySelectorAll(".replay")].map((place) => new Replay(place));

function begin() {
  if (typeof Bokeh !== "undefined" && plots() === null) {
    requestAnimationFrame(begin);
    return;
  }
  connectPlots();
  repaint();
  for (const replay of replays) replay.show(replay.time);
  document.documentElement.dataset.ready = "true";
}

darkMode.addEventListener("change", repaint);
printing.addEventListener("change", repaint);
addEventListener("beforeprint", repaint);
addEventListener("afterprint", repaint);
begin();
