// A card for each servo: how it is in words and colour, position against goal, temperature, voltage, current.
// state: {servos: [[goal, position, current, temperature, voltage, torque, level, words], ...], chosen: index}
motiondeck.part("servo-cards", (element, state, send) => {
  const about = JSON.parse(element.dataset.fixed).servos;
  const { child, write } = motiondeck;
  const fixed = (value, digits) => value.toFixed(digits).replace(/^-(?=[0.]*$)/, ""); // no -0
  const unit = (value, digits, name) => (value === null ? "–" : fixed(value, digits) + name);
  const degrees = (angle) => fixed((angle * 180) / Math.PI, 0);
  state.servos.forEach(([goal, position, current, temperature, voltage, torque, level, words], index) => {
    const { joint, id, model, lower, upper, hottest } = about[index];
    const card = child(element, joint, "button", "");
    card.className = `servo-card ${level}${index === state.chosen ? " chosen" : ""}`;
    card.title = `${joint}: id ${id}, ${model}. Where it is / where it should be, degrees; temperature, voltage, current`;
    card.onclick = () => send({ choose: index });
    write(child(card, "joint", "b", ""), joint.replaceAll("_", " "));
    write(child(card, "words", "span", "words"), torque ? ` ${words}` : ` ${words}, torque off`);
    const bar = child(card, "bar", "span", "bar");
    const place = (angle) => `${(100 * (angle - lower)) / (upper - lower)}%`;
    child(bar, "goal", "i", "goal").style.left = place(goal);
    child(bar, "here", "i", "here").style.left = place(position);
    const figures = child(card, "figures", "span", "figures");
    write(child(figures, "angle", "span", ""), ` ${degrees(position)}/${degrees(goal)}°`);
    const heat = child(figures, "heat", "span", "");
    heat.className = temperature > hottest - 12 ? "alarm" : "";
    write(heat, ` ${unit(temperature, 0, "°C")}`);
    write(child(figures, "volt", "span", ""), ` ${unit(voltage, 1, "V")}`);
    write(child(figures, "amp", "span", ""), ` ${unit(current, 2, "A")}`);
    card.setAttribute("aria-label", card.textContent); // as it is read
  });
});
