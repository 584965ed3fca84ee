// The explorer of an imager's frames: a picture, the figures of its frame, and one pixel over frames.

/** A number as text: whole ones as they are, others to five digits. */
function figure(value) {
  if (value === null) return "–";
  return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(5)));
}

class Frames {
  constructor(root, given) {
    this.given = given;
    this.at = 0;
    this.pixel = null;
    const { count, shown, columns, step } = given, last = shown.length - 1;
    this.play = element("button", { type: "button" }, "Play");
    this.speed = choice([[1, "real time"], [8, "8 times slower"], [40, "40 times slower"], [0, "4 frames a second"]], 0);
    this.scrub = element("input", { type: "range", min: 0, max: last, value: 0, class: "scrub", "aria-label": "frame" });
    this.number = choice(shown.map((of, n) => [n, given.numbers[of]]), 0);
    this.time = element("output");
    this.levels = choice([["full", "0 to full scale"], ["frame", "least to most of the frame"],
      ["all", "least to most of all frames"]], "full");
    this.tone = choice([["display", "as on a display (sRGB)"], ["linear", "linear"]], "display");
    this.save = element("button", { type: "button" }, "Save picture (PNG)");
    this.table = element("button", { type: "button" }, "Save figures of all frames (CSV)");
    this.values = element("button", { type: "button", disabled: true }, "Save values of the pixel (CSV)");
    this.drawn = choice(columns.map((one, n) => [n, one.name]), columns.findIndex((one) => one.name === given.drawn));
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": "frame" });
    this.facts = element("div", { class: "facts" });
    this.told = element("p", { "aria-live": "polite" }, "Click a pixel, or focus the picture and use the arrow keys. " +
      "Page Up and Page Down go to the frame before and after, the space bar plays.");
    this.course = element("canvas", { class: "raster", role: "img", "aria-label": "value of the pixel over the frames" });
    this.other = element("canvas", { class: "raster", role: "img", "aria-label": "a figure over the frames" });
    const part = step === 1 ? "with every pixel" : `with one pixel of ${step} x ${step}`;
    const which = shown.length === count ? `All ${count} frames are` : `${shown.length} of the ${count} frames, evenly spread, are`;
    root.append(
      element("div", { class: "controls" }, labelled("black to white", this.levels), labelled("tone", this.tone), this.save, this.table),
      element("div", { class: "controls time" }, this.play, labelled("speed", this.speed), this.scrub,
        labelled("frame", this.number), this.time),
      element("p", { class: "soft" }, `${which} in this page, ${part}.`),
      element("div", { class: "frame" }, element("figure", {}, this.canvas), this.facts), this.told,
      element("div", { class: "controls" }, labelled("also over the frames", this.drawn), this.values),
      this.course, this.other
    );
    this.course.hidden = true;
    for (const control of [this.levels, this.tone]) control.addEventListener("change", () => this.draw());
    this.drawn.addEventListener("change", () => this.trace());
    this.scrub.addEventListener("input", () => this.go(Number(this.scrub.value)));
    this.number.addEventListener("change", () => this.go(Number(this.number.value)));
    this.play.addEventListener("click", () => this.toggle());
    this.save.addEventListener("click", () =>
      this.canvas.toBlob((blob) => saved(`frame-${given.numbers[shown[this.at]]}.png`, blob)));
    this.table.addEventListener("click", () => this.saveFigures());
    this.values.addEventListener("click", () => this.savePixel());
    pointing(this.canvas, () => this.pixel, (x, y) => {
      this.pixel = [x, y];
      this.draw();
    });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { PageUp: this.at - 1, PageDown: this.at + 1, Home: 0, End: last }[event.key];
      if (event.key === " ") this.toggle();
      else if (by === undefined) return;
      else this.go(by);
      event.preventDefault();
    });
  }

  async open() {
    this.bytes = new Uint8Array(await unpacked(this.given.values));
    this.half = this.bytes.length / 2;
    this.at = this.firstLit();
    this.draw();
  }

  /** The first frame that reaches a quarter of the range of all values: those before are dark. */
  firstLit() {
    let least = Infinity;
    const most = this.given.sizes.map(([rows, columns], n) => {
      let high = 0;
      for (let y = 0; y < rows; y++) for (let x = 0; x < columns; x++) {
        const value = this.value(n, x, y);
        high = Math.max(high, value);
        least = Math.min(least, value);
      }
      return high;
    });
    return most.findIndex((high) => high >= least + (Math.max(...most) - least) / 4);
  }

  /** Value of a pixel in the n-th frame shown; null beyond a smaller frame. */
  value(n, x, y) {
    const { width, height, sizes } = this.given, [rows, columns] = sizes[n];
    if (y >= rows || x >= columns) return null;
    const at = (n * height + y) * width + x;
    return this.bytes[at] | this.bytes[this.half + at] << 8;
  }

  go(n) {
    this.at = Math.min(Math.max(n, 0), this.given.shown.length - 1);
    if (this.restart) this.restart();  // plays on from here
    this.draw();
  }

  toggle() {
    this.playing = !this.playing;
    this.play.textContent = this.playing ? "Pause" : "Play";
    this.restart = null;
    if (!this.playing) return;
    const { shown, ready } = this.given, last = shown.length - 1;
    if (this.at === last) this.at = 0;
    let begun, from;
    this.restart = () => { begun = performance.now(); from = this.at; };
    this.restart();
    this.speed.onchange = this.restart;
    const step = (now) => {
      if (!this.playing) return;
      const slower = Number(this.speed.value), passed = Math.max(now - begun, 0), before = this.at;
      if (!slower) this.at = Math.min(from + Math.floor(passed / 250), last);
      else while (this.at < last && ready[shown[this.at + 1]] - ready[shown[from]] <= passed / slower) this.at++;
      if (this.at !== before) this.draw();
      if (this.at === last) this.toggle();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  draw() {
    const { given, canvas, at } = this, [rows, columns] = given.sizes[at], of = given.shown[at];
    const [black, white] = this.range(), table = this.tone.value === "display" ? CURVE : LINEAR;
    this.scrub.value = this.number.value = at;
    this.time.textContent = `ready at ${figure(given.ready[of])} ms`;
    canvas.width = columns;
    canvas.height = rows;
    const context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
    const pixels = new Uint32Array(image.data.buffer), level = new Uint8ClampedArray(1);
    for (let y = 0; y < rows; y++) {
      for (let x = 0; x < columns; x++) {
        level[0] = 255 * (this.value(at, x, y) - black) / (white - black);
        pixels[y * columns + x] = table[level[0]];
      }
    }
    context.putImageData(image, 0, 0);
    if (this.pixel) framed(context, this.pixel, columns);
    this.tell(of);
    this.trace();
  }

  /** Values that are black and white. */
  range() {
    const [least, most] = ["least", "most"].map((name) => this.given.columns.find((one) => one.name === name).values);
    const of = this.given.shown[this.at];
    const [black, white] = {
      full: [0, this.given.full], frame: [least[of], most[of]],
      all: [least.reduce((a, b) => Math.min(a, b)), most.reduce((a, b) => Math.max(a, b))],
    }[this.levels.value];
    return [black, Math.max(white, black + 1)];
  }

  /** The figures of a frame, and which of them differ from the frame before. */
  tell(of) {
    const groups = new Map();
    for (const { group, name, unit, text, values } of this.given.columns) {
      const changed = of > 0 && values[of] !== values[of - 1];
      const cell = element("td", {}, `${figure(values[of])}${unit ? ` ${unit}` : ""}`);
      if (changed) cell.append(element("span", { class: "was" }, ` was ${figure(values[of - 1])}`));
      const row = element("tr", { class: changed && group !== "Frame" ? "changed" : "" },
        element("th", { scope: "row", title: text }, name.replaceAll("_", " ")), cell);
      if (!groups.has(group)) groups.set(group, element("tbody"));
      groups.get(group).append(row);
    }
    this.facts.replaceChildren(...[...groups].map(([group, rows]) =>
      element("table", {}, element("caption", {}, group), rows)));
  }

  trace() {
    const { given, pixel } = this, { shown } = given;
    this.values.disabled = !pixel;
    if (pixel) {
      const [x, y] = pixel, [u, v] = this.place(), list = shown.map((_, n) => this.value(n, x, y));
      const now = list[this.at], known = list.filter((value) => value !== null);
      const mean = known.reduce((a, b) => a + b, 0) / Math.max(known.length, 1);
      this.told.textContent = `Pixel x ${u}, y ${v}: ` + (now === null ? "not in this frame" : `${now} ${given.unit} in this frame`) +
        `; mean of the ${known.length} frames shown ${figure(mean)} ${given.unit}.`;
      this.chart(this.course, `pixel x ${u}, y ${v}, ${given.unit}`, shown.map((of, n) => [of, list[n]]));
    }
    const { name, unit, values } = given.columns[Number(this.drawn.value)];
    this.chart(this.other, `${name.replaceAll("_", " ")}${unit ? `, ${unit}` : ""}`, values.map((value, n) => [n, value]));
  }

  /** Place of the pixel pointed at on the imager. */
  place() {
    return this.pixel.map((n) => this.given.off + n * this.given.step);
  }

  chart(canvas, title, points) {
    const plot = new Plot(canvas, 150), { numbers, shown } = this.given, known = points.filter((p) => p[1] !== null);
    const left = 64, right = plot.width - 8, upper = 22, low = 126, count = Math.max(numbers.length - 1, 1);
    let least = Math.min(...known.map((p) => p[1])), most = Math.max(...known.map((p) => p[1]));
    if (!known.length) [least, most] = [0, 1];
    if (least === most) [least, most] = [least - 1, most + 1];
    const at = ([n, value]) => [left + n / count * (right - left), low - (value - least) / (most - least) * (low - upper)];
    plot.text(title, left, 13);
    plot.line([[left, upper], [left, low], [right, low]]);
    plot.text(figure(most), left - 4, upper + 8, "right");
    plot.text(figure(least), left - 4, low, "right");
    plot.text(`frame ${numbers[0]}`, left, 142);
    plot.text(`${numbers.at(-1)}`, right, 142, "right");
    const now = left + shown[this.at] / count * (right - left);
    plot.line([[now, upper], [now, low]], "#ffb000", [4, 3]);
    plot.line(known.map(at), "#2f7ed8");
    plot.c.fillStyle = "#2f7ed8";
    if (known.length <= 200) for (const [u, v] of known.map(at)) plot.c.fillRect(u - 2, v - 2, 4, 4);
  }

  saveFigures() {
    const { columns, numbers } = this.given;
    const head = columns.map((one) => one.name + (one.unit ? `_${one.unit}` : ""));
    csv("frames.csv", [["frame", ...head], ...numbers.map((number, n) => [number, ...columns.map((one) => one.values[n] ?? "")])]);
  }

  savePixel() {
    const { shown, numbers, ready } = this.given, [x, y] = this.pixel, [u, v] = this.place();
    csv(`pixel-${u}-${v}.csv`, [["x", "y", "frame", "ready_ms", `value_${this.given.unit.replaceAll(" ", "_")}`],
      ...shown.map((of, n) => [u, v, numbers[of], ready[of], this.value(n, x, y) ?? ""])]);
  }
}

KINDS.frames = Frames;
