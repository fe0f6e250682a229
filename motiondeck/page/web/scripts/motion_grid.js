// A button with a picture for each motion; a field to search; the queue below, to take out of and to reorder.
// state: {labels: [text], looks: ["playing" | "next" | ""], enabled, queue: [name], orders: can the queue be reordered}
// sends {play: name}, {queue: name}, {order: [name]}
motiondeck.part("motion-grid", (element, state, send) => {
  const { motions, searched, verdicts } = JSON.parse(element.dataset.fixed);
  const { child, write } = motiondeck;
  if (motions.length > searched) {
    const field = child(element, "search", "input", "search");
    field.placeholder = "search a motion";
    field.setAttribute("aria-label", field.placeholder);
    field.oninput = () => {
      const found = motions.filter((name) => name.toLowerCase().includes(field.value.trim().toLowerCase()));
      for (const name of motions) child(grid, name, "div", "motion").hidden = !found.includes(name);
      write(child(element, "none", "div", "none"), found.length ? "" : "no motion is named like this");
    };
    child(element, "none", "div", "none");
  }
  const grid = child(element, "grid", "div", "motions");
  motions.forEach((name, index) => {
    const box = child(grid, name, "div", "motion");
    box.dataset.look = state.looks[index];
    if (index < 9) box.dataset.keyNumber = index + 1;
    const button = child(box, "play", "button", "play");
    button.disabled = !state.enabled;
    const [answer, words] = verdicts[name] ?? ["", ""];
    const part = state.labels[index].slice(name.length).replace(" · ", " ");
    button.setAttribute("aria-label", name + part + (answer && ` ${answer}`)); // as it is read
    button.title = (index < 9 ? `${name}: key ${index + 1}` : name) + (words && `\n${words}`);
    button.onclick = (event) => send(event.shiftKey ? { queue: name } : { play: name });
    child(button, "picture", "span", "picture");
    write(child(button, "name", "b", ""), name);
    write(child(button, "part", "i", ""), part || "\u00a0");
    if (answer) {
      const verdict = child(button, "verdict", "i", "verdict");
      verdict.dataset.answer = answer.replace(/ .*/, ""); // plays, at or does
      write(verdict, ` ${answer}`);
    }
    const later = child(box, "later", "button", "later");
    later.disabled = !state.enabled;
    later.textContent = "+";
    later.title = `after what plays now and the queue: ${name} (or shift and click)`;
    later.setAttribute("aria-label", `queue: ${name}`);
    later.onclick = () => send({ queue: name });
  });
  const queue = child(element, "queue", "div", "queue");
  const chips = state.queue.map((name, place) => {
    const chip = document.createElement("span");
    const press = (text, label, order) => {
      const button = document.createElement("button");
      button.textContent = text;
      button.setAttribute("aria-label", label);
      button.disabled = !state.orders || !state.enabled;
      button.onclick = () => send({ order });
      return button;
    };
    const rest = state.queue.filter((_, other) => other !== place);
    const sooner = [...rest.slice(0, place - 1), name, ...rest.slice(place - 1)];
    chip.append(`${place + 1}. ${name} `);
    if (place) chip.append(press("◀", `sooner: ${name}`, sooner));
    chip.append(press("✕", `take out: ${name}`, rest));
    return chip;
  });
  queue.replaceChildren(...(chips.length ? ["next: ", ...chips] : []));
});

// Pictures for the buttons of a grid. state: {grid: id, poses: {name: [pose]}, parents}
motiondeck.part("motion-pictures", (element, { grid, poses, parents }) => {
  for (const box of document.querySelectorAll(`#${grid} .motion, [data-of="${grid}"] .motion`)) {
    const place = box.querySelector(".picture");
    const own = poses[box.dataset.key];
    if (own && !place.firstChild) place.innerHTML = motiondeck.figure(own, parents);
  }
});
