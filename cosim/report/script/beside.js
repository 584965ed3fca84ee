// The explorer of pictures of several things.

/** Pictures of several things in several views at several instants: two of them side by side. */
class Beside {
  constructor(root, given) {
    this.given = given;
    const names = given.names.map((name, n) => [n, name]);
    this.left = choice(names, 0);
    this.right = choice(names, Math.min(1, names.length - 1));
    this.view = choice(given.views.map((view, n) => [n, view]), 0);
    this.instant = choice(given.instants.map((text, n) => [n, text]), given.instants.length >> 1);
    this.canvases = ["left", "right", "right − left"].map((title) => {
      const canvas = element("canvas", { role: "img", "aria-label": title });
      return [canvas, element("figcaption")];
    });
    root.append(
      element("div", { class: "controls" }, labelled("left", this.left), labelled("right", this.right),
        labelled(given.viewed, this.view), labelled("instant", this.instant)),
      element("div", { class: "pictures" }, ...this.canvases.map((pair) => element("figure", {}, ...pair)))
    );
    if (given.names.length === 1) {
      for (const one of [this.left, this.right]) one.parentElement.hidden = true;
      for (const [canvas] of this.canvases.slice(1)) canvas.parentElement.hidden = true;
    }
    for (const control of [this.left, this.right, this.view, this.instant]) {
      control.addEventListener("change", () => this.draw());
    }
  }

  async open() {
    await this.draw();
  }

  async picture(name) {
    const image = new Image();
    image.src = this.given.pictures[this.view.value][name][this.instant.value];
    await image.decode();
    return image;
  }

  async draw() {
    const chosen = [Number(this.left.value), Number(this.right.value)];
    const images = await Promise.all(chosen.map((name) => this.picture(name)));
    const data = images.map((image, n) => {
      const [canvas, caption] = this.canvases[n];
      canvas.width = image.width;
      canvas.height = image.height;
      caption.textContent = this.given.names[chosen[n]];
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    });
    const [canvas, caption] = this.canvases[2], off = data[1];
    const codes = data.map((one) => new Uint8Array(one.data.buffer).slice());
    const pixels = new Uint32Array(off.data.buffer), level = new Uint8ClampedArray(1);
    for (let n = 0; n < pixels.length; n++) {
      level[0] = 128 + 2 * (codes[1][4 * n] - codes[0][4 * n]);
      pixels[n] = SIGNED[level[0]];
    }
    canvas.width = off.width;
    canvas.height = off.height;
    canvas.getContext("2d").putImageData(off, 0, 0);
    caption.textContent = "right − left: red where the right one is brighter, blue where it is darker";
  }
}

KINDS.beside = Beside;
