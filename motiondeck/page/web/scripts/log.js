// The log of the run: what has happened, the latest first, found by words. Nothing is sent while it is not in sight.
// asks with {known: how many it has had} each second while it is in sight; sends {moment} to look at what was then
window.motiondeck.log ??= (() => {
  const { child, write } = motiondeck;
  const EVERY = 1000; // ms
  let [card, told, count, entries] = [null, -EVERY, -1, []];
  let send = () => {};

  function tell() {
    const looking = Boolean(card?.isConnected && card.getClientRects().length && document.visibilityState === "visible");
    if (looking && performance.now() - told >= EVERY) send({ known: count }), (told = performance.now());
  }

  const clock = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;

  function show() {
    if (!card) return;
    const words = card.find.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = entries.filter(([at, , kind, title, text, alarming]) => {
      const all = `${clock(at)} ${kind} ${title} ${text}`.toLowerCase();
      return (!card.alarms.checked || alarming) && words.every((word) => all.includes(word));
    });
    write(card.count, `${found.length} of ${entries.length}`);
    card.list.replaceChildren(
      ...found.map(([at, moment, kind, title, text, alarming]) => {
        const row = document.createElement("button");
        row.className = alarming ? "entry alarming" : "entry";
        write(child(row, "at", "span", "at"), clock(at));
        write(child(row, "title", "b", ""), title || kind);
        write(child(row, "text", "span", "text"), text);
        row.onclick = () => send({ moment });
        return row;
      }),
    );
  }

  function build(element, say) {
    send = say;
    if (!card) {
      card = document.createElement("div");
      card.className = "log";
      card.find = child(card, "find", "input", "");
      Object.assign(card.find, { type: "search", placeholder: "cause, servo or time", oninput: show });
      card.find.setAttribute("aria-label", "find in the log");
      const only = child(card, "only", "label", "");
      card.alarms = child(only, "alarms", "input", "");
      Object.assign(card.alarms, { type: "checkbox", onchange: show });
      only.append(" alarms only");
      card.count = child(card, "count", "span", "count");
      card.count.setAttribute("role", "status");
      card.list = child(card, "list", "div", "list");
      setInterval(tell, 200);
    }
    element.append(card);
  }

  return { build, take: (state) => (({ count, entries } = state), show()) };
})();
motiondeck.part("log", (element, state, send) => motiondeck.log.build(element, send));
// state, of one browser: {count, entries: [[s of the run, moment, kind, title, text, whether it is an alarm]]}
motiondeck.part("log-entries", (element, state) => motiondeck.log.take(state));
