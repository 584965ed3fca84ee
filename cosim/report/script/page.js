// Script of report pages: enlarged figures, definitions at hand, and cues of wide tables.
"use strict";
(() => {
  const byId = (name) => document.getElementById(name);
  const each = (what, act) => document.querySelectorAll(what).forEach(act);
  document.documentElement.classList.add("js");

  // Figures. A picture of few pixels grows by whole factors, so that no pixel is wider than another.
  const large = byId("large"), picture = byId("large-picture"), save = byId("large-save");
  let pixels = false;
  const fit = () => {
    const wide = 0.94 * innerWidth / picture.naturalWidth;
    const tall = (0.94 * innerHeight - 90) / picture.naturalHeight;
    let times = Math.min(wide, tall);
    if (pixels && times > 1) times = Math.floor(times);
    if (!pixels) times = Math.min(times, 2);
    if (!pixels && innerWidth < 600) times = Math.max(times, 1);  // its text is read by scrolling
    picture.classList.toggle("pixels", pixels && times > 1);
    picture.style.width = `${Math.floor(picture.naturalWidth * times)}px`;
  };
  const enlarge = (figure) => {
    const from = figure.querySelector("img");
    const caption = figure.querySelector("figcaption").firstChild.textContent;
    pixels = !figure.classList.contains("plot");
    picture.alt = from.alt;
    picture.src = save.href = from.src;
    const name = caption.toLowerCase().replace(/[^\w]+/g, "-").slice(0, 40) || "figure";
    save.download = name + (from.src.startsWith("data:image/png") ? ".png" : ".jpg");
    byId("large-caption").textContent = caption;
    large.showModal();
    picture.decode().then(fit, () => {});
  };
  each("figure", (figure) => {
    const image = figure.querySelector("img");
    if (!image) return;
    figure.querySelector(".enlarge").setAttribute("aria-label", `Enlarge: ${image.alt}`);
    figure.querySelector(".enlarge").addEventListener("click", () => enlarge(figure));
    image.addEventListener("click", () => enlarge(figure));
  });
  byId("large-close").addEventListener("click", () => large.close());
  large.addEventListener("click", (event) => { if (event.target === large) large.close(); });

  // Definitions: by pointer, touch and keyboard. Escape hides one.
  const note = byId("definition");
  const hide = () => { note.hidden = true; each("dfn[aria-describedby]", (term) => term.removeAttribute("aria-describedby")); };
  const define = (term) => {
    hide();
    note.textContent = term.dataset.definition;
    note.hidden = false;
    term.setAttribute("aria-describedby", "definition");
    const at = term.getClientRects()[0], room = document.documentElement.clientWidth - note.offsetWidth - 8;
    note.style.left = `${Math.max(8, Math.min(at.left, room))}px`;
    const below = at.bottom + 6, fits = below + note.offsetHeight < innerHeight;
    note.style.top = `${fits ? below : Math.max(8, at.top - note.offsetHeight - 6)}px`;
  };
  each("dfn[title]", (term) => {
    term.dataset.definition = term.title;
    term.removeAttribute("title");
    for (const kind of ["mouseenter", "focus", "click"]) term.addEventListener(kind, () => define(term));
    for (const kind of ["mouseleave", "blur"]) term.addEventListener(kind, hide);
  });
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") hide(); });
  addEventListener("scroll", hide, { passive: true });

  // What is wider than its place can be scrolled by keyboard, and says so.
  const wide = () => each(".scroll, pre", (box) => {
    const over = box.scrollWidth > box.clientWidth + 1;
    box.classList.toggle("over", over);
    if (box.parentElement.classList.contains("wide")) box.parentElement.classList.toggle("over", over);
    if (over) box.tabIndex = 0; else box.removeAttribute("tabindex");
  });
  wide();
  addEventListener("resize", () => { wide(); if (large.open) fit(); });

  if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
    each("video", (clip) => { clip.autoplay = false; clip.pause(); });
  }
})();
