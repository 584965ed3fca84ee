// The explorer of the cells of a link: maps of errors and certainty, and of one cell its wrong decisions
// and soft values over time and its eye diagram. Soft values are in the page for some cells only.

const ON = "#d9480f", OFF = "#2f7ed8", LEVELS = 24;

/** Soft values of the watched cells: see `cell_soft.py`. */
class Watched {
  constructor(given) {
    this.given = given;
  }

  async open() {
    const { given } = this, of = async (name, kind) => new kind(await unpacked(given[name]));
    this.cells = await of("cells", Int32Array);
    this.symbols = await of("symbols", Int32Array);
    this.soft = await of("soft", Int8Array);
    this.sent = await of("sent", Uint8Array);
    this.start = await of("start", Float32Array);
    this.width = Math.ceil((this.symbols.at(-1) - this.symbols[0] + 3) / 8);
  }

  /** Number among the watched cells of the one nearest to a place on the panel. */
  nearest(x, y, columns) {
    let best = 0, least = Infinity;
    this.cells.forEach((cell, n) => {
      const far = (cell % columns - x) ** 2 + (Math.floor(cell / columns) - y) ** 2;
      if (far < least) [best, least] = [n, far];
    });
    return best;
  }

  bit(n, symbol) {
    const at = symbol - this.symbols[0] + 1;
    return this.sent[n * this.width + (at >> 3)] >> (7 - (at & 7)) & 1;
  }

  /** Of cell n: number, soft value, bits sent before, in and after, and place in a tick of each symbol. */
  samples(n) {
    const { top, period } = this.given, count = this.symbols.length;
    return Array.from(this.symbols, (symbol, k) => {
      const level = this.soft[n * count + k], begin = this.start[n] + symbol * period;
      return {
        symbol, soft: Math.sign(level) * top * (level / 127) ** 2, sent: this.bit(n, symbol),
        before: this.bit(n, symbol - 1), after: this.bit(n, symbol + 1), phase: begin - Math.floor(begin),
      };
    });
  }
}

/** The cells of a link: wrong decisions and certainty on a map, and those of one cell over time. */
class Cells {
  constructor(root, given) {
    this.given = given;
    const { first, stop } = given, limits = { type: "number", min: first, max: stop };
    this.shown = choice([["wrong", "wrong decisions"], ["sure", "certainty, mean |soft value|"],
      ...(given.watched ? [["watched", "cells with soft values in this page"]] : [])], "wrong");
    this.from = element("input", { ...limits, value: first });
    this.to = element("input", { ...limits, value: stop });
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": "map of cells" });
    this.facts = element("p", { "aria-live": "polite" }, "Click a cell, or focus the map and use the arrow keys.");
    this.scale = element("p", { class: "soft" });
    this.time = element("canvas", { class: "raster", role: "img", "aria-label": "wrong decisions of the cell over time" });
    this.time.hidden = true;
    this.watched = given.watched ? new Watched(given.watched) : null;
    root.append(
      element("div", { class: "controls" }, labelled("shown", this.shown), labelled("from symbol", this.from),
        labelled("to symbol", this.to)),
      element("figure", { class: "map" }, this.canvas), this.scale, this.facts, this.time
    );
    if (this.watched) this.buildSoft(root);
    for (const control of [this.shown, this.from, this.to]) control.addEventListener("change", () => this.draw());
    pointing(this.canvas, () => this.cell, (x, y) => {
      this.cell = [x, y];
      this.draw();
    });
  }

  buildSoft(root) {
    const plot = (label, points) => element("canvas", {
      class: "raster", role: "img", "aria-label": label, hidden: true, ...(points ? { tabIndex: 0 } : {}),
    });
    this.against = choice([["history", "the bits before and after"], ["phase", "its place in a tick"]], "history");
    this.of = choice([["cell", "this cell"], ["all", "all cells with soft values"]], "cell");
    this.table = element("button", { type: "button" }, "Save soft values (CSV)");
    this.softly = element("p", { "aria-live": "polite" });
    this.course = plot("soft value of the cell over the symbols");
    this.eye = plot("eye diagram of the cell", true);
    this.counted = element("p", { class: "soft", role: "status" });
    this.eyeControls = element("div", { class: "controls", hidden: true },
      labelled("eye diagram of", this.of), labelled("against", this.against), this.table);
    root.append(this.softly, this.course, this.eyeControls, this.eye, this.counted);
    for (const control of [this.of, this.against]) {
      control.addEventListener("change", () => { this.bin = null; this.drawEye(); });
    }
    this.table.addEventListener("click", () => this.save());
    const at = (event) => {
      const box = this.eye.getBoundingClientRect();
      const column = Math.floor((event.clientX - box.left - this.left) / this.wide);
      const row = Math.floor((event.clientY - box.top - this.upper) / this.high);
      const inside = column >= 0 && column < this.counts.length && row >= 0 && row < LEVELS;
      this.bin = inside ? [column, row] : null;
      this.drawEye();
    };
    this.eye.addEventListener("pointermove", at);
    this.eye.addEventListener("click", at);
    this.eye.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!by) return;
      const [x, y] = this.bin ?? [0, LEVELS >> 1], within = (v, n) => Math.min(Math.max(v, 0), n - 1);
      this.bin = [within(x + by[0], this.counts.length), within(y + by[1], LEVELS)];
      this.drawEye();
      event.preventDefault();
    });
  }

  async open() {
    if (this.watched) await this.watched.open();
    this.sure = new Uint8Array(await unpacked(this.given.sure));
    this.wrong = new Int32Array(await unpacked(this.given.wrong));
    this.places = new Int32Array(await unpacked(this.given.places));
    this.draw();
  }

  draw() {
    const { columns, rows, top, whole } = this.given, { canvas, wrong } = this;
    const from = Number(this.from.value), to = Number(this.to.value), count = new Int32Array(wrong.length);
    for (let n = 0; n < this.places.length; n += 2) {
      if (this.places[n] >= from && this.places[n] < to) count[this.places[n + 1]]++;
    }
    canvas.width = columns;
    canvas.height = rows;
    const context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
    const pixels = new Uint32Array(image.data.buffer), most = count.reduce((a, b) => Math.max(a, b), 1);
    const errors = this.shown.value === "wrong", kept = this.shown.value === "watched";
    const held = new Set(kept ? this.watched.cells : []);
    for (let n = 0; n < pixels.length; n++) {
      const grey = wrong[n] < 0 ? 235 : errors ? 24 : kept ? (held.has(n) ? 160 : 24) : this.sure[n] * 0.8;
      pixels[n] = 0xff000000 | (grey << 16) | (grey << 8) | grey;
    }
    if (errors) {
      for (let n = 0; n < pixels.length; n++) {
        if (count[n]) pixels[n] = 0xff000000 | ((60 + 140 * count[n] / most) << 8) | 255;
      }
    }
    context.putImageData(image, 0, 0);
    this.scale.textContent = errors
      ? `Red to yellow: 1 to ${most} wrong decisions of a cell in these symbols. Pale: tags and pilots.` +
        (whole ? "" : " Only the first wrong decisions of the run are listed.")
      : kept ? `Grey: the ${held.size} cells whose soft values are in this page, of the first ` +
        `${this.watched.symbols.length} symbols: a lattice over the panel, and the least certain ones.`
      : `Black to white: 0 to ${top.toFixed(1)} nats over the whole run.`;
    if (!this.cell) return;
    const [x, y] = this.cell;
    context.strokeStyle = "#38c0ff";
    context.lineWidth = Math.max(1, columns / 250);
    context.strokeRect(x - 3.5, y - 3.5, 8, 8);
    this.tell(x, y, count);
  }

  tell(x, y, count) {
    const { columns, symbols, top, first, stop, homography: h, side } = this.given, n = y * columns + x;
    const u = (x + 0.5) * side - 0.5, v = (y + 0.5) * side - 0.5;
    const parts = [`Cell in row ${y}, column ${x}`];
    if (this.wrong[n] < 0) parts.push("carries a tag or a pilot");
    else {
      parts.push(`wrong in ${this.wrong[n]} of ${symbols} symbols, ${count[n]} of them in those shown`);
      parts.push(`mean |soft value| ${(this.sure[n] / 255 * top).toFixed(1)} nats`);
    }
    if (h) {
      const w = h[6] * u + h[7] * v + h[8];
      const at = [(h[0] * u + h[1] * v + h[2]) / w, (h[3] * u + h[4] * v + h[5]) / w];
      parts.push(`its image is around camera pixel x ${at[0].toFixed(1)}, y ${at[1].toFixed(1)}`);
    }
    this.facts.textContent = `${parts.join("; ")}.`;
    const plot = new Plot(this.time, 70), { c, width, ink } = plot;
    c.strokeStyle = ink;
    c.strokeRect(8, 20, width - 16, 24);
    plot.text("wrong decisions over the symbols of the run", 8, 12);
    plot.text(`${first}`, 8, 60);
    plot.text(`${stop}`, width - 8, 60, "right");
    c.fillStyle = ON;
    for (let k = 0; k < this.places.length; k += 2) {
      if (this.places[k + 1] !== n) continue;
      c.fillRect(8 + (this.places[k] - first + 0.5) / (stop - first) * (width - 16) - 1, 20, 2, 24);
    }
    if (this.watched) this.tellSoft(x, y);
  }

  /** Soft values of the cell, or of the nearest one whose soft values are in the page. */
  tellSoft(x, y) {
    const { columns } = this.given, n = this.watched.nearest(x, y, columns), cell = this.watched.cells[n];
    this.held = [cell % columns, Math.floor(cell / columns)];
    this.samples = this.watched.samples(n);
    const [u, v] = this.held, own = u === x && v === y;
    const wrong = this.samples.filter((one) => (one.soft > 0 ? 1 : 0) !== one.sent).length;
    this.softly.textContent = (own ? "Soft values of this cell"
      : `Soft values of the nearest cell that has them in this page, row ${v}, column ${u}`) +
      `: ${this.samples.length} symbols, ${wrong} wrong. Above 0 the cell is decided as on.`;
    this.eyeControls.hidden = false;
    this.bin = null;
    this.drawCourse();
    this.drawEye();
  }

  get top() {
    return this.samples.reduce((most, one) => Math.max(most, Math.abs(one.soft)), 1) * 1.05;
  }

  drawCourse() {
    const plot = new Plot(this.course, 190), { c, width } = plot, { samples, top } = this;
    const left = 46, right = width - 8, upper = 22, low = 168, middle = (upper + low) / 2;
    const first = samples[0].symbol, last = samples.at(-1).symbol + 1;
    const at = (one) => [left + (one.symbol + 0.5 - first) / (last - first) * (right - left),
      middle - one.soft / top * (low - upper) / 2];
    plot.text("soft value, nats; ring: wrong", left, 13);
    plot.text("sent on", right - 54, 13, "right", ON);
    plot.text("sent off", right, 13, "right", OFF);
    plot.line([[left, upper], [left, low], [right, low]]);
    plot.line([[left, middle], [right, middle]], plot.ink, [3, 3]);
    for (const [value, y] of [[top, upper + 8], [0, middle + 4], [-top, low]]) plot.text(value.toFixed(1), left - 4, y, "right");
    plot.text(`${first}`, left, 184);
    plot.text(`${last - 1}`, right, 184, "right");
    for (const one of samples) {
      const [u, v] = at(one);
      c.fillStyle = one.sent ? ON : OFF;
      c.fillRect(u - 1.5, v - 1.5, 3, 3);
      if ((one.soft > 0 ? 1 : 0) === one.sent) continue;
      c.strokeStyle = plot.ink;
      c.beginPath();
      c.arc(u, v, 5, 0, 7);
      c.stroke();
    }
  }

  get eyeTop() {
    return this.of.value === "cell" ? this.top : this.given.watched.top;
  }

  /** Counts of soft values: by column, level from the top, and bit sent. */
  count() {
    const history = this.against.value === "history", top = this.eyeTop;
    const counts = Array.from({ length: history ? 4 : 16 }, () => new Uint32Array(2 * LEVELS));
    const all = this.of.value === "cell" ? [this.samples] : Array.from(this.watched.cells, (_, n) => this.watched.samples(n));
    let from = 1, to = 0;
    for (const { phase } of all.flat()) [from, to] = [Math.min(from, phase), Math.max(to, phase)];
    to = Math.max(to, from + 1e-6);
    this.phases = [from, to];
    const add = (one) => {
      const share = (one.phase - from) / (to - from);
      const column = history ? 2 * one.before + one.after : Math.min(Math.floor(16 * share), 15);
      const level = Math.min(Math.max(Math.floor((1 - one.soft / top) / 2 * LEVELS), 0), LEVELS - 1);
      counts[column][2 * level + one.sent]++;
    };
    all.flat().forEach(add);
    return counts;
  }

  drawEye() {
    const plot = new Plot(this.eye, 290), { c, width } = plot, top = this.eyeTop;
    const history = this.against.value === "history", drawn = `${this.held} ${this.of.value} ${this.against.value}`;
    if (this.drawn !== drawn) this.counts = this.count();
    this.drawn = drawn;
    const { counts } = this, most = Math.max(...counts.map((one) => Math.max(...one)), 1);
    const [left, upper] = [this.left, this.upper] = [46, 22], right = width - 8, low = 250;
    const wide = this.wide = (right - left) / counts.length, high = this.high = (low - upper) / LEVELS;
    plot.text("soft value, nats", 2, 13);
    plot.text("sent on", right - 54, 13, "right", ON);
    plot.text("sent off", right, 13, "right", OFF);
    counts.forEach((of, column) => {
      for (let n = 0; n < of.length; n++) {
        if (!of[n]) continue;
        const sent = n & 1, u = left + column * wide + (sent ? wide / 2 : 1);
        c.globalAlpha = 0.2 + 0.8 * Math.sqrt(of[n] / most);
        c.fillStyle = sent ? ON : OFF;
        c.fillRect(u, upper + (n >> 1) * high, wide / 2 - 1, high);
      }
    });
    c.globalAlpha = 1;
    plot.line([[left, upper], [left, low], [right, low]]);
    plot.line([[left, (upper + low) / 2], [right, (upper + low) / 2]], plot.ink, [3, 3]);
    for (const [value, y] of [[top, upper + 8], [0, (upper + low) / 2 + 4], [-top, low]]) plot.text(value.toFixed(1), left - 4, y, "right");
    const name = (column) => `${column >> 1 ? "on" : "off"} _ ${column & 1 ? "on" : "off"}`;
    if (history) counts.forEach((_, column) => plot.text(name(column), left + (column + 0.5) * wide, 266, "center"));
    else {
      plot.text(this.phase(0), left, 266);
      plot.text(this.phase(16), right, 266, "right");
    }
    plot.text(history ? "bits sent before and after this one" : "where in a tick the symbol begins, ticks", (left + right) / 2, 284, "center");
    this.counted.textContent = "Point at the diagram, or focus it and use the arrow keys, for counts.";
    if (!this.bin) return;
    const [column, level] = this.bin, at = (n) => (top * (1 - 2 * n / LEVELS)).toFixed(1);
    c.strokeStyle = plot.ink;
    c.strokeRect(left + column * wide, upper + level * high, wide, high);
    const where = history ? `between ${name(column).replace(" _ ", " and ")}`
      : `begun at ${this.phase(column)} to ${this.phase(column + 1)} of a tick`;
    this.counted.textContent = `Soft value ${at(level + 1)} to ${at(level)}, ${where}: ` +
      `${counts[column][2 * level]} symbols sent off, ${counts[column][2 * level + 1]} sent on.`;
  }

  /** Where in a tick column n of the diagram begins. */
  phase(n) {
    const [from, to] = this.phases;
    return (from + n / 16 * (to - from)).toFixed(4);
  }

  save() {
    const [column, row] = this.held, rows = this.samples.map((one) =>
      [row, column, one.symbol, one.sent, one.soft.toFixed(3), one.before, one.after, one.phase.toFixed(4)]);
    csv(`cell-${row}-${column}.csv`,
      [["row", "column", "symbol", "sent", "soft_nats", "sent_before", "sent_after", "phase_ticks"], ...rows]);
  }
}

KINDS.cells = Cells;
