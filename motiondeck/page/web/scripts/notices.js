// One line of notices over the scene's lower edge. state: {alarms: [[title, cause, servos, count]], the latest or none,
// more: how many others wait, passing: [title, text] or null}. sends {acknowledge: [title, cause, ...]}
motiondeck.part("notices", (element, { alarms: [alarm], more, passing }, send) => {
  const { child, write } = motiondeck;
  const line = child(element.dataset.of ? element : document.body, "notices", "div", "notices");
  if (!element.dataset.of) line.dataset.in = "inspect";
  line.setAttribute("role", "log");
  const shown = child(line, "alarm", "div", "notice alarm");
  shown.hidden = !alarm;
  const [title, cause, servos, count] = alarm ?? ["", "", "", 0];
  const words = child(shown, "words", "div", "");
  if (element.dataset.of) words.tabIndex = 0; // it scrolls there
  write(child(words, "title", "b", ""), `${title}${count > 1 ? ` × ${count}` : ""} `);
  write(child(words, "cause", "span", ""), cause);
  const names = child(words, "servos", "small", "");
  write(names, servos);
  names.title = servos;
  const button = child(shown, "acknowledge", "button", "");
  write(button, more > 0 ? `Acknowledge (${more}\u00a0more)` : "Acknowledge");
  button.onclick = () => send({ acknowledge: alarm });
  const other = child(line, "passing", "div", "notice");
  other.hidden = !passing;
  write(child(other, "title", "b", ""), passing ? `${passing[0]} ` : "");
  write(child(other, "text", "span", ""), passing ? passing[1] : "");
});
