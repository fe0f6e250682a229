// A look inside as a card over the scene: how far the motions overlap, and the phases of the centers.
// state: {motion, names, overlap: [[0 to 1]], centers: [turns]}; null for none. It sends nothing.
motiondeck.part("network-card", (element, state) => {
  const { child } = motiondeck;
  const card = child(document.body, "network-card", "div", "network-card");
  card.hidden = !state;
  if (!state) return;
  const { motion, names, overlap, centers } = state;
  const here = names.indexOf(motion);
  const cells = overlap.flatMap((row, y) =>
    row.map((value, x) => {
      const hue = x === here || y === here ? "38 110 200" : "73 80 87";
      return `<rect x="${x}" y="${y}" width="1" height="1" fill="rgb(${hue} / ${value})"><title></title></rect>`;
    }),
  );
  const near = here < 0 ? [] : overlap[here].map((value, x) => [value, names[x]]).filter(([, name]) => name !== motion);
  const dials = centers.map((turns) => {
    const [x, y] = [Math.cos(2 * Math.PI * turns), -Math.sin(2 * Math.PI * turns)];
    return `<svg viewBox="-1.2 -1.2 2.4 2.4"><circle r="1" fill="none" stroke="#ced4da" stroke-width=".16"/>
      <line x2="${x}" y2="${y}" stroke="#266ec8" stroke-width=".16"/><circle cx="${x}" cy="${y}" r=".2" fill="#266ec8"/></svg>`;
  });
  const map = `<b>overlap of motions</b><svg class="map" viewBox="0 0 ${names.length} ${names.length}">${cells.join("")}</svg>`;
  const turning = `<b>${centers.length > 1 ? `${centers.length} centers` : "center"}</b><div class="dials">${dials.join("")}</div>`;
  card.innerHTML = (names.length ? `${map}<div class="near"></div>` : "") + (centers.length ? turning : "");
  card.querySelectorAll(".map title").forEach((title, k) => {
    const [y, x] = [Math.floor(k / names.length), k % names.length];
    title.textContent = `${names[y]} and ${names[x]}: ${overlap[y][x]}`;
  });
  const most = near.sort(([a], [b]) => b - a).slice(0, 2);
  const said = most.map(([value, name]) => `${name} ${Math.round(100 * value)} %`).join(", ");
  if (names.length) card.querySelector(".near").textContent = said && `${motion}: most with ${said}`;
});
