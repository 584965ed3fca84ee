// The explorer of the tiles of a plan.

/** The tiles of a plan: where an effect is kept, what leaving it out could change, and all that is
 * known of the tile pointed at. */
class Tiles {
  constructor(root, given) {
    this.given = given;
    this.effect = choice(given.effects.map((one, n) => [n, one.name]), given.first);
    this.canvas = element("canvas", { tabIndex: 0, role: "img", "aria-label": "map of tiles" });
    this.scale = element("p", { class: "soft" });
    this.facts = element("ul", { "aria-live": "polite" });
    root.append(
      element("div", { class: "controls" }, labelled("effect", this.effect)),
      element("figure", { class: "map" }, this.canvas), this.scale, this.facts
    );
    this.effect.addEventListener("change", () => this.draw());
    pointing(this.canvas, () => this.tile, (x, y) => {
      this.tile = [x, y];
      this.draw();
    });
  }

  async open() {
    for (const one of this.given.effects) {
      one.keeps = new Uint8Array(await unpacked(one.kept));
      one.bounds = new Float32Array(await unpacked(one.bound));
    }
    this.tiers = new Uint8Array(await unpacked(this.given.tier));
    this.checked = new Set(this.given.checked);
    this.draw();
  }

  draw() {
    const { columns, rows, effects } = this.given, { canvas } = this;
    const { keeps, bounds } = effects[Number(this.effect.value)];
    const out = bounds.filter((_, n) => !keeps[n]), most = out.reduce((a, b) => Math.max(a, b), 0);
    canvas.width = columns;
    canvas.height = rows;
    const context = canvas.getContext("2d"), image = context.createImageData(columns, rows);
    for (let n = 0; n < columns * rows; n++) {
      const share = most > 0 ? Math.min(bounds[n] / most, 1) : 0;
      const colour = keeps[n] ? [40, 70, 120] : [255, 245 - 150 * share, 220 - 190 * share];
      image.data.set([...colour, 255], 4 * n);
    }
    context.putImageData(image, 0, 0);
    const number = keeps.length - out.length;
    this.scale.textContent = `Blue: kept, in ${number} of ${keeps.length} tiles.` + (out.length
      ? ` Pale to orange: left out, where that changes the rate by at most 0 to ${most.toPrecision(2)}.` : "");
    if (!this.tile) return;
    const [x, y] = this.tile, n = y * columns + x;
    context.strokeStyle = "#38c0ff";
    context.strokeRect(x - 0.5, y - 0.5, 2, 2);
    const lines = [
      `Tile in row ${y}, column ${x}: ${this.given.tiers[this.tiers[n]]}${this.checked.has(n) ? ", checked as a whole" : ""}`,
      ...effects.map((one) => one.keeps[n] ? `${one.name}: kept`
        : `${one.name}: left out, at most ${one.bounds[n].toPrecision(2)}`),
    ];
    this.facts.replaceChildren(...lines.map((line) => element("li", {}, line)));
  }
}

KINDS.tiles = Tiles;
