// What the explorers of a page share: elements, colours of pixels, pointing at cells, plots, files.
//
// `explorers.py` joins this file, those of the kinds that a page holds, and `start.js` to one script.

/** Class of an explorer by its kind. */
const KINDS = {};

async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

function element(name, given = {}, ...inner) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(given)) {
    if (key in made && key !== "list") made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...inner);
  return made;
}

function labelled(text, control) {
  return element("label", {}, element("span", {}, text), control);
}

function choice(options, chosen) {
  const made = element("select");
  for (const [value, text] of options) made.append(element("option", { value }, text));
  made.value = chosen;
  return made;
}

/** Calls `pick` with the place in a map of cells that is clicked, or moved to by arrow keys from the
 * place that `now` returns. */
function pointing(canvas, now, pick) {
  const within = (x, y) => pick(
    Math.min(Math.max(x, 0), canvas.width - 1), Math.min(Math.max(y, 0), canvas.height - 1)
  );
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect();
    within(Math.floor((event.clientX - box.left) / box.width * canvas.width),
      Math.floor((event.clientY - box.top) / box.height * canvas.height));
  });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!by) return;
    const [x, y] = now() ?? [canvas.width >> 1, canvas.height >> 1];
    within(x + by[0], y + by[1]);
    event.preventDefault();
  });
}

function saved(name, blob) {
  const link = element("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** A table of colours for the pixels of a canvas: [red, green, blue] of each of 256 levels. */
function colours(of) {
  const bytes = new Uint8ClampedArray(1024);
  for (let n = 0; n < 256; n++) bytes.set([...of(n), 255], 4 * n);
  return new Uint32Array(bytes.buffer);
}

function srgb(n) {
  const v = n / 255;
  return 255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
}

const LINEAR = colours((n) => [n, n, n]), CURVE = colours((n) => [srgb(n), srgb(n), srgb(n)]);
/** Blue below the true light, red above it; full colour at a quarter of white. */
const SIGNED = colours((n) => {
  const off = (n - 128) / 127;
  return [255 * Math.min(1 + off, 1), 255 * (1 - Math.abs(off)), 255 * Math.min(1 - off, 1)];
});

/** A square around a pixel of a picture that is so many pixels wide. */
const framed = (context, [x, y], width) => {
  const half = Math.max(2, Math.round(width / 60));
  context.strokeStyle = "#ffb000";
  context.lineWidth = Math.max(1, width / 250);
  context.strokeRect(x - half + 0.5, y - half + 0.5, 2 * half, 2 * half);
};

/** A canvas to draw lines and text on, in CSS pixels. */
class Plot {
  constructor(canvas, height) {
    const ratio = devicePixelRatio || 1;
    canvas.hidden = false;
    this.width = canvas.clientWidth || 600;
    this.height = height;
    canvas.width = this.width * ratio;
    canvas.height = height * ratio;
    canvas.style.height = `${height}px`;
    this.c = canvas.getContext("2d");
    this.c.scale(ratio, ratio);
    this.c.font = "12px system-ui, sans-serif";
    this.ink = getComputedStyle(canvas).color;
  }

  line(points, colour = this.ink, dash = []) {
    const { c } = this;
    c.strokeStyle = colour;
    c.setLineDash(dash);
    c.beginPath();
    points.forEach(([u, v], n) => (n ? c.lineTo(u, v) : c.moveTo(u, v)));
    c.stroke();
    c.setLineDash([]);
  }

  text(words, u, v, align = "left", colour = this.ink) {
    this.c.fillStyle = colour;
    this.c.textAlign = align;
    this.c.fillText(words, u, v);
  }
}

function csv(name, rows) {
  const text = rows.map((row) => `${row.join(",")}\n`).join("");
  saved(name, new Blob([text], { type: "text/csv" }));
}
