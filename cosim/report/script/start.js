// Opens every explorer of the page, and draws its plots anew for another width or scheme of colours.

const opened = [];
for (const root of document.querySelectorAll(".explorer")) {
  if (root.explorer) continue;
  const given = JSON.parse(root.querySelector("script").textContent);
  const explorer = new KINDS[root.dataset.kind](root, given);
  root.explorer = explorer;
  explorer.opened = explorer.open().then(() => { opened.push(explorer); });
}

const again = () => { for (const explorer of opened) (explorer.trace ?? explorer.draw).call(explorer); };
addEventListener("resize", again);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
