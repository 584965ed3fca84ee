// The explorer of the cells of a link.

/** The cells of a link: wrong decisions and certainty on a map, and those of one cell over time. */
class Cells {
  constructor(root, given) {
    this.given = given;
    const { first, stop } = given, limits = { type: "number", min: first, max: stop };
    this.shown = choice([["wrong", "wrong decisions"], ["sure", "certainty, mean |soft value|"]], "wrong");
    this.from = element("input", { ...limits, value: first });
    this.to = element("input", { ...limits, value: stop });
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": "map of cells" });
    this.facts = element("p", { "aria-live": "polite" }, "Click a cell, or focus the map and use the arrow keys.");
    this.scale = element("p", { class: "soft" });
    this.time = element("canvas", { class: "raster", role: "img", "aria-label": "wrong decisions of the cell over time" });
    this.time.hidden = true;
    root.append(
      element("div", { class: "controls" }, labelled("shown", this.shown), labelled("from symbol", this.from),
        labelled("to symbol", this.to)),
      element("figure", { class: "map" }, this.canvas), this.scale, this.facts, this.time
    );
    for (const control of [this.shown, this.from, this.to]) control.addEventListener("change", () => this.draw());
    pointing(this.canvas, () => this.cell, (x, y) => {
      this.cell = [x, y];
      this.draw();
    });
  }

  async open() {
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
    const errors = this.shown.value === "wrong";
    for (let n = 0; n < pixels.length; n++) {
      const grey = wrong[n] < 0 ? 235 : errors ? 24 : this.sure[n] * 0.8;
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
    const { time } = this, ratio = devicePixelRatio || 1;
    time.hidden = false;
    const width = time.clientWidth || 600;
    time.width = width * ratio;
    time.height = time.clientHeight * ratio;
    const c = time.getContext("2d"), ink = getComputedStyle(time).color;
    c.scale(ratio, ratio);
    c.font = "12px system-ui, sans-serif";
    c.fillStyle = c.strokeStyle = ink;
    c.strokeRect(8, 20, width - 16, 24);
    c.fillText("wrong decisions over the symbols of the run", 8, 12);
    c.fillText(`${first}`, 8, 60);
    c.textAlign = "right";
    c.fillText(`${stop}`, width - 8, 60);
    c.fillStyle = "#d9480f";
    for (let k = 0; k < this.places.length; k += 2) {
      if (this.places[k + 1] !== n) continue;
      c.fillRect(8 + (this.places[k] - first + 0.5) / (stop - first) * (width - 16) - 1, 20, 2, 24);
    }
  }
}

KINDS.cells = Cells;
