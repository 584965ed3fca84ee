// Opens every explorer of the page.

for (const root of document.querySelectorAll(".explorer")) {
  if (root.explorer) continue;
  const given = JSON.parse(root.querySelector("script").textContent);
  const explorer = new KINDS[root.dataset.kind](root, given);
  root.explorer = explorer;
  explorer.opened = explorer.open();
}
