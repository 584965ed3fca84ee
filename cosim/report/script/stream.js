// The explorer of a spike stream: images at any cycle, side by side with the true light, and the spikes
// of one pixel. The same code runs in report.html, where it computes images from spikes inside the
// page, and in `viform view`, where a local server sends the rates of an image. Levels follow
// `viform image`: round(255 clip(x / scale, 0, 1)) with halves to even, from rates in single precision.

const WORD = 32;
const WIDEST = 1001;  // cycles of a window

function popcount(x) {
  x -= (x >>> 1) & 0x55555555;
  x = (x & 0x33333333) + ((x >>> 2) & 0x33333333);
  x = (x + (x >>> 4)) & 0x0f0f0f0f;
  return Math.imul(x, 0x01010101) >>> 24;
}

/** Bits of word w that belong to cycles first to stop. */
function mask(w, first, stop) {
  const low = Math.max(first - w * WORD, 0), high = Math.min(stop - w * WORD, WORD);
  if (high <= low) return 0;
  const upper = high === WORD ? 0xffffffff : (1 << high) - 1;
  return (upper & ~((1 << low) - 1)) >>> 0;
}

/** Linear levels of rates, white at `scale`. A clamped array rounds halves to even. */
function levels(rates, scale) {
  const out = new Uint8ClampedArray(rates.length);
  for (let n = 0; n < out.length; n++) out[n] = 255 * (rates[n] / scale);
  return out;
}

/** Levels 255 - tau of interval lengths, 0 where there is none; `longest` cycles are black. */
function tauLevels(tau, longest) {
  const out = new Uint8ClampedArray(tau.length), share = 255 / longest;
  for (let n = 0; n < tau.length; n++) out[n] = Math.min(tau[n], longest) * share;
  for (let n = 0; n < tau.length; n++) out[n] = tau[n] > 0 ? 255 - out[n] : 0;
  return out;
}

/** Spikes of some pixels inside the page: words (pixel, word), cycles `first` to `stop`. */
class Embedded {
  constructor(view, first, stop) {
    Object.assign(this, view, { first, stop });
  }

  async open() {
    this.words = new Uint32Array(await unpacked(this.data));
    this.perPixel = this.words.length / (this.width * this.height);
    this.shown = this.truth ? new Uint8Array(await unpacked(this.truth.data)) : null;
  }

  /** First spike at or after cycle c, or -1. */
  after(pixel, c) {
    const base = pixel * this.perPixel;
    for (let w = Math.max(c, 0) >> 5; w < this.perPixel; w++) {
      const bits = this.words[base + w] & mask(w, c, this.stop - this.first);
      if (bits) return w * WORD + 31 - Math.clz32(bits & -bits);
    }
    return -1;
  }

  /** Last spike before cycle c, or -1. */
  before(pixel, c) {
    const base = pixel * this.perPixel;
    for (let w = Math.min((c - 1) >> 5, this.perPixel - 1); w >= 0; w--) {
      const bits = (this.words[base + w] & mask(w, 0, c)) >>> 0;
      if (bits) return w * WORD + 31 - Math.clz32(bits);
    }
    return -1;
  }

  /** Length of the interval that holds cycle c, as `isi` of the program; 0 without one. */
  interval(pixel, c) {
    let begin = this.before(pixel, c), end = this.after(pixel, c);
    if (begin < 0 && end >= 0) {
      begin = end;
      end = this.after(pixel, begin + 1);
    } else if (end < 0 && begin >= 0) {
      end = begin;
      begin = this.before(pixel, end);
    }
    return begin >= 0 && end >= 0 ? end - begin : 0;
  }

  async rates(at, method, window) {
    const c = at - this.first, last = this.stop - this.first;
    const out = new Float32Array(this.width * this.height);
    if (method !== "tfp") {
      for (let n = 0; n < out.length; n++) {
        const tau = this.interval(n, c);
        out[n] = method === "tau" || tau === 0 ? tau : 1 / tau;
      }
      return out;
    }
    const half = window >> 1, from = Math.max(c - half, 0), to = Math.min(c + half + 1, last);
    for (let n = 0; n < out.length; n++) {
      let count = 0;
      for (let w = from >> 5; w * WORD < to; w++) {
        count += popcount(this.words[n * this.perPixel + w] & mask(w, from, to));
      }
      out[n] = count / (to - from);
    }
    return out;
  }

  async spikes(x, y, from, to) {
    const found = [], pixel = y * this.width + x;
    let c = this.after(pixel, from - this.first);
    while (c >= 0 && c < to - this.first) {
      found.push(c + this.first);
      c = this.after(pixel, c + 1);
    }
    return found;
  }

  /** True light of pixel n at a cycle, 255 = white: linear between the instants in the page. */
  truthOf(n, at) {
    const cycles = this.truth.cycles, size = this.width * this.height;
    let k = 0;
    while (k < cycles.length - 2 && cycles[k + 1] <= at) k++;
    const next = Math.min(k + 1, cycles.length - 1), span = cycles[next] - cycles[k];
    const share = span > 0 ? Math.min(Math.max((at - cycles[k]) / span, 0), 1) : 0;
    const low = this.shown[k * size + n], high = this.shown[next * size + n];
    return low + (high - low) * share;
  }

  async light(at) {
    if (!this.truth) return null;
    const out = new Uint8ClampedArray(this.width * this.height);
    for (let n = 0; n < out.length; n++) out[n] = this.truthOf(n, at);
    return out;
  }

  async course(x, y, cycles) {
    return this.truth ? cycles.map((c) => this.truthOf(y * this.width + x, c) / 255) : null;
  }
}

/** The stream of a run behind the local server of `viform view`. */
class Served {
  constructor(view, first, stop, token) {
    Object.assign(this, view, { first, stop, token });
  }

  async open() {}

  async fetched(what, values) {
    const query = new URLSearchParams({ token: this.token, ...values });
    const answer = await fetch(`${what}?${query}`);
    if (!answer.ok) throw new Error(await answer.text());
    return answer;
  }

  async rates(at, method, window) {
    const answer = await this.fetched("rates", { at, method, window });
    return new Float32Array(await answer.arrayBuffer());
  }

  async spikes(x, y, first, stop) {
    return (await this.fetched("spikes", { x, y, first, stop })).json();
  }

  async light(at) {
    if (!this.truth) return null;
    return new Uint8ClampedArray(await (await this.fetched("light", { at })).arrayBuffer());
  }

  async course(x, y, cycles) {
    if (!this.truth) return null;
    return (await this.fetched("course", { x, y, cycles: cycles.join(" ") })).json();
  }
}

class Explorer {
  constructor(root, given) {
    this.given = given;
    this.sources = given.views.map((view) =>
      given.token
        ? new Served(view, given.first, given.stop, given.token)
        : new Embedded(view, given.first, given.stop)
    );
    this.at = Math.min(Math.max(given.at, given.first), given.stop - 1);
    this.pixel = null;
    this.wanted = false;
    this.build(root);
  }

  get source() {
    return this.sources[Number(this.views.value)];
  }

  build(root) {
    const { first, stop, window, white } = this.given;
    this.views = choice(this.sources.map((s, n) => [n, s.name]), 0);
    this.method = choice(
      [["tfp", "TFP: mean of a window"], ["tfi", "TFI: 1 / interval"], ["tau", "255 − τ"]], "tfp"
    );
    this.window = element("input", { type: "number", min: 1, step: 2, max: WIDEST, value: window });
    this.scale = element("input", { type: "number", min: 0.0001, step: "any", value: white });
    this.tone = choice([["display", "as on a display (sRGB)"], ["linear", "linear"]], "display");
    this.scrub = element("input", {
      type: "range", min: first, max: stop - 1, step: 1, value: this.at, class: "scrub",
      "aria-label": "cycle",
    });
    this.number = element("input", { type: "number", min: first, max: stop - 1, value: this.at });
    this.play = element("button", { type: "button" }, "Play");
    const speeds = [1000, 200, 40, 8, 1].map((n) => [n, n === 1 ? "real time" : `${n} times slower`]);
    this.speed = choice(speeds, 40);
    this.time = element("output");
    this.status = element("p", { class: "soft", role: "status" });
    this.pictures = {};
    const row = element("div", { class: "pictures" });
    for (const [key, title] of [["spikes", "from spikes"], ["light", "true light"],
      ["difference", "spikes − light: red brighter, blue darker, full at ¼ of white"]]) {
      const canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": title });
      this.pictures[key] = { canvas, box: element("figure", {}, canvas, element("figcaption", {}, title)) };
      row.append(this.pictures[key].box);
      pointing(canvas, () => this.pixel, (x, y) => this.pick(x, y));
      canvas.addEventListener("keydown", (event) => {
        if (event.key !== " ") return;
        this.toggle();
        event.preventDefault();
      });
    }
    this.save = element("button", { type: "button" }, "Save picture (PNG)");
    this.table = element("button", { type: "button", disabled: true }, "Save spikes (CSV)");
    this.span = choice([[128, "128 cycles"], [512, "512 cycles"], [2048, "2048 cycles"]], 512);
    this.plot = element("canvas", { class: "raster", role: "img", "aria-label": "spikes of the pixel" });
    this.facts = element("p", { "aria-live": "polite" }, "Click a pixel, or focus a picture and use the arrow keys.");
    root.append(
      element("div", { class: "controls" }, labelled("part", this.views), labelled("method", this.method),
        labelled("window, cycles", this.window), labelled("white, spikes/cycle", this.scale),
        labelled("tone", this.tone), this.save),
      element("div", { class: "controls time" }, this.play, labelled("speed", this.speed), this.scrub,
        labelled("cycle", this.number), this.time),
      this.status, row,
      element("div", { class: "controls" }, labelled("time shown", this.span), this.table),
      this.facts, this.plot
    );
    for (const control of [this.method, this.window, this.scale, this.tone]) {
      control.addEventListener("change", () => this.draw());
    }
    this.views.addEventListener("change", () => { this.pixel = null; this.draw(); });
    this.span.addEventListener("change", () => this.trace());
    this.scrub.addEventListener("input", () => this.go(Number(this.scrub.value)));
    this.number.addEventListener("change", () => this.go(Number(this.number.value)));
    this.play.addEventListener("click", () => this.toggle());
    this.save.addEventListener("click", () => this.savePicture());
    this.table.addEventListener("click", () => this.saveSpikes());
  }

  async open() {
    for (const source of this.sources) await source.open();
    await this.draw();
  }

  go(cycle) {
    const { first, stop } = this.given;
    if (!Number.isFinite(cycle)) return;
    this.at = Math.min(Math.max(Math.round(cycle), first), stop - 1);
    this.scrub.value = this.number.value = this.at;
    if (this.playing) this.restart();  // goes on from here
    this.draw();
  }

  toggle() {
    this.playing = !this.playing;
    this.play.textContent = this.playing ? "Pause" : "Play";
    if (!this.playing) return;
    let begun = performance.now(), from = this.at >= this.given.stop - 1 ? this.given.first : this.at;
    const step = async (now) => {
      if (!this.playing) return;
      const cycle = from + (Math.max(now - begun, 0) / 1000) * this.given.hz / Number(this.speed.value);
      if (cycle >= this.given.stop - 1) this.toggle();
      this.at = Math.min(Math.floor(cycle), this.given.stop - 1);
      this.scrub.value = this.number.value = this.at;
      await this.draw();
      requestAnimationFrame(step);
    };
    this.restart = () => { begun = performance.now(); from = this.at; };
    this.speed.onchange = this.restart;
    requestAnimationFrame(step);
  }

  /** Draws what is chosen now. While a picture is on its way, one more is remembered. */
  async draw() {
    if (this.drawing) { this.wanted = true; return this.drawing; }
    this.drawing = this.drawOnce().catch((error) => { this.status.textContent = error.message; });
    await this.drawing;
    this.drawing = null;
    if (this.wanted) { this.wanted = false; return this.draw(); }
  }

  async drawOnce() {
    const { source, at } = this, method = this.method.value, scale = Number(this.scale.value);
    const window = Math.min(Math.max(1, Number(this.window.value) | 1), WIDEST);
    if (!(scale > 0)) throw new Error("white must be a rate above 0");
    this.window.value = window;
    this.window.disabled = method !== "tfp";
    this.scale.disabled = method === "tau";
    const [rates, light] = await Promise.all([source.rates(at, method, window), source.light(at)]);
    const codes = method === "tau" ? tauLevels(rates, 255) : levels(rates, scale);
    const table = this.tone.value === "display" ? CURVE : LINEAR;
    this.codes = codes;
    this.paint("spikes", codes, method === "tau" ? LINEAR : table);
    this.pictures.light.box.hidden = !light;
    this.pictures.difference.box.hidden = !light || method === "tau";
    if (light) this.paint("light", light, table);
    if (light && method !== "tau") {
      const off = new Uint8ClampedArray(codes.length);
      for (let n = 0; n < off.length; n++) off[n] = 128 + 508 * (rates[n] / scale - light[n] / 255);
      this.paint("difference", off, SIGNED);
    }
    this.time.textContent = `${((at + 0.5) / this.given.hz * 1e3).toFixed(3)} ms`;
    this.status.textContent = this.given.note;
    await this.trace();
  }

  paint(key, codes, table) {
    const { width, height } = this.source, { canvas } = this.pictures[key];
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const context = canvas.getContext("2d"), image = context.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    for (let n = 0; n < pixels.length; n++) pixels[n] = table[codes[n]];
    context.putImageData(image, 0, 0);
    if (this.pixel) framed(context, this.pixel, width);
  }

  pick(x, y) {
    this.pixel = [x, y];
    this.table.disabled = false;
    return this.draw();
  }

  /** Cycles that the raster shows. */
  range() {
    const { first, stop } = this.given, long = Math.min(Number(this.span.value), stop - first);
    const from = Math.min(Math.max(this.at - (long >> 1), first), stop - long);
    return [from, from + long];
  }

  async trace() {
    const { source, pixel, plot } = this;
    plot.hidden = !pixel;
    if (!pixel) return;
    const [x, y] = pixel, [from, to] = this.range(), { white } = this.given;
    const cycles = Array.from({ length: 129 }, (_, n) => Math.round(from + (to - 1 - from) * n / 128));
    const [spikes, light] = await Promise.all([
      source.spikes(x, y, from, to), source.course(x, y, cycles),
    ]);
    this.listed = { x: source.x + x * source.step, y: source.y + y * source.step, spikes };
    this.chart(from, to, spikes, light && light.map((v) => v * white), cycles);
    const gaps = spikes.slice(1).map((c, n) => c - spikes[n]);
    const mean = gaps.length ? gaps.reduce((a, b) => a + b) / gaps.length : null;
    const text = [
      `Pixel x ${this.listed.x}, y ${this.listed.y}: ${spikes.length} spikes in ${to - from} cycles`,
      mean === null ? "no whole interval" : `mean interval ${mean.toFixed(2)} cycles`,
    ];
    if (light) text.push(`true light ${(light[64] * white).toFixed(4)} spikes/cycle in the middle`);
    this.facts.textContent = `${text.join("; ")}.`;
  }

  /** The raster of spikes, 1 / interval and true light over time, and the charge since the last
   * spike as the true light collects it. */
  chart(from, to, spikes, light, cycles) {
    const plot = new Plot(this.plot, 280), { ink } = plot, left = 52, right = plot.width - 8;
    const x = (cycle) => left + (cycle + 0.5 - from) / (to - from) * (right - left);
    const line = plot.line.bind(plot), text = plot.text.bind(plot);
    text("spikes", 2, 24);
    for (const spike of spikes) line([[x(spike), 10], [x(spike), 32]], ink);
    const rates = [];
    for (let n = 1; n < spikes.length; n++) {
      const rate = 1 / (spikes[n] - spikes[n - 1]);
      rates.push([x(spikes[n - 1]), rate], [x(spikes[n]), rate]);
    }
    const top = Math.max(1e-6, ...rates.map((p) => p[1]), ...(light ?? [])) * 1.1;
    const low = light ? 166 : 250, y = (v) => low - v / top * (low - 60);
    line([[left, 60], [left, low], [right, low]], ink);
    text(top.toPrecision(2), left - 4, 68, "right");
    text("0", left - 4, low, "right");
    if (light) line(cycles.map((n, k) => [x(n), y(light[k])]), "#d9480f");
    line(rates.map(([u, v]) => [u, y(v)]), "#2f7ed8");
    text("1 / interval, spikes/cycle", left, 52);
    if (light) {
      text("true light", left + 170, 52, "left", "#d9480f");
      const at = (n) => light[Math.min(Math.floor((n - from) / (to - from) * 128), 128)];
      const charge = [];
      let sum = null, next = 0;
      for (let n = from; n < to; n++) {
        if (sum !== null) { sum += at(n); charge.push([x(n), sum]); }
        if (spikes[next] === n) { charge.push([x(n), 0]); sum = 0; next++; }
      }
      const most = Math.max(1.2, ...charge.map((p) => p[1])), base = 256;
      line([[left, 196], [left, base], [right, base]], ink);
      line([[left, base - 60 / most], [right, base - 60 / most]], ink, [3, 3]);
      line(charge.map(([u, v]) => [u, base - v / most * 60]), "#3a9d5d");
      text("1", left - 4, base - 60 / most + 4, "right");
      text("light since the last spike, thresholds", left, 188);
    }
    line([[x(this.at), 6], [x(this.at), low]], "#ffb000", [4, 3]);
    text(`cycle ${from}`, left, 274);
    text(`${to - 1}`, right, 274, "right");
  }

  savePicture() {
    const { canvas } = this.pictures.spikes;
    canvas.toBlob((blob) => saved(`cycle-${this.at}-${this.method.value}.png`, blob));
  }

  saveSpikes() {
    const { x, y, spikes } = this.listed, { hz } = this.given;
    const rows = spikes.map((cycle) => [x, y, cycle, (cycle + 1) / hz]);
    csv(`pixel-${x}-${y}.csv`, [["x", "y", "cycle", "latched_s"], ...rows]);
  }
}

KINDS.stream = Explorer;
