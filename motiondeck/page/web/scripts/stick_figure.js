// Stick figures and curves of joints as SVG, for buttons and film strips.
{
  const [INK, PALE] = ["#1c4f8c", "#a9bdd6"];
  const TURN = (35 * Math.PI) / 180; // from the side towards the front

  // The last of some poses drawn dark, those before it pale, as one square picture. Poses are positions of the joints, the
  // root first, m; parents of bones are -1 for the root, and bone b ends at joint 1 + b.
  motiondeck.figure = (poses, parents) => {
    const flat = poses.map((pose) => pose.map(([x, y, z]) => [x * Math.cos(TURN) + y * Math.sin(TURN), -z]));
    const every = flat.flat();
    const [low, high] = [Math.min, Math.max].map((pick) => [0, 1].map((axis) => pick(...every.map((place) => place[axis]))));
    const scale = 88 / Math.max(high[0] - low[0], high[1] - low[1], 1e-6);
    const at = (place) => [0, 1].map((axis) => Math.round(50 + scale * (place[axis] - (low[axis] + high[axis]) / 2))).join(" ");
    const paths = flat.map((pose, place) => {
      const bones = parents.map((parent, bone) => `M${at(pose[parent + 1])}L${at(pose[bone + 1])}`).join("");
      return `<path d="${bones}" stroke="${place === flat.length - 1 ? INK : PALE}"/>`;
    });
    return `<svg viewBox="0 0 100 100" width="64" height="64" fill="none" stroke-width="5" stroke-linecap="round" aria-hidden="true">${paths.join("")}</svg>`;
  };

  // How joints turned, as one wide picture of their angles; those that hardly move are pale.
  const curves = (angles) => {
    const every = angles.flat();
    const [low, high] = [Math.min(...every), Math.max(...every)];
    const moved = angles.map((row) => Math.max(...row) - Math.min(...row));
    const paths = angles.map((row, joint) => {
      const points = row.map((angle, k) => `${Math.round((300 * k) / (row.length - 1))} ${(2 + (56 * (high - angle)) / Math.max(high - low, 1e-6)).toFixed(1)}`);
      return `<path stroke="${moved[joint] > 0.25 * Math.max(...moved) ? INK : PALE}" d="M${points.join("L")}"/>`;
    });
    return `<svg viewBox="0 0 300 60" preserveAspectRatio="none" fill="none" stroke-width="1.5">${paths.join("")}</svg>`;
  };

  // Poses of a recording, or how its joints turned. state: {figures: [pose], parents, angles: [[rad]]}, null for none
  motiondeck.part("film-strip", (element, state) => {
    element.className = "film-strip";
    const { figures, parents, angles } = state ?? { figures: [], parents: [], angles: [] };
    element.innerHTML = figures.map((pose) => motiondeck.figure([pose], parents)).join("") + (angles.length ? curves(angles) : "");
  });
}
