// One line of notices over the scene's lower edge. state: {alarms: [[title, cause, servos, count]], the latest or none,
// more: how many others wait, passing: [title, text] or null}. sends {acknowledge: [title, cause, ...]}
// Before them stands that the page has lost its deck, which no server can say.
motiondeck.link ??= (() => {
  const { child, write } = motiondeck;
  const root = document.documentElement;
  let ended = false; // after the end none is missed
  let deck = false;
  setInterval(() => {
    const line = document.querySelector("#state-line");
    if (line) ended = line.dataset.word === "ENDED";
    deck ||= Boolean(document.querySelector('[data-part="motion-grid"]'));
    const lost = !ended && (!document.querySelector("#part-events") || Boolean(line?.closest('div[style*="pointer-events: none"]')));
    root.dataset.link = lost ? "lost" : "";
    for (const notice of document.querySelectorAll(".notice.lost")) {
      notice.hidden = !lost;
      const what = deck ? "deck: the robot" : "show: its robots";
      write(child(notice, "what", "b", ""), `No connection to the ${what} may still move. Reconnecting.`);
      write(child(notice, "remedy", "span", ""), deck ? "In a terminal, motiondeck send estop stops it." : "");
    }
  }, 100);
  return true;
})();
motiondeck.part("notices", (element, { alarms: [alarm], more, passing }, send) => {
  const { child, write } = motiondeck;
  const line = child(element.dataset.of ? element : document.body, "notices", "div", "notices");
  if (!element.dataset.of) line.dataset.in = "inspect";
  line.setAttribute("role", "log");
  const lost = child(line, "lost", "div", "notice lost");
  lost.hidden = document.documentElement.dataset.link !== "lost";
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
