// Draws the page's own parts from JSON that the server keeps up to date, and sends back what is done with them.
//
// A part is an element with data-part="KIND"; its state is in data-state of the element with data-state-of="ID".
// A kind registers how it is drawn: motiondeck.part(KIND, draw), draw(element, state, send). send(value) reaches the
// server through a text field that viser keeps in step; the field is hidden.
window.motiondeck ??= (() => {
  const kinds = {};
  const drawn = new WeakMap();
  const setValue = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  let number = 0;

  // viser sends what the field holds every 50 ms at most: of two parts that send at once, the second waits.
  const APART = 60; // ms
  const waiting = new Map();
  let busy = false;

  function sender(id) {
    return (value) => {
      waiting.set(id, value);
      if (!busy) sendNext();
    };
  }

  function sendNext() {
    const [next] = waiting;
    busy = Boolean(next);
    if (!next) return;
    const [id, value] = next;
    waiting.delete(id);
    setTimeout(sendNext, APART);
    const field = document.getElementById("part-events")?.parentElement?.nextElementSibling?.querySelector("input");
    if (!field) return;
    number += 1;
    // The number makes two equal events differ: a field that does not change is not sent.
    setValue.call(field, JSON.stringify([id, value, `${performance.timeOrigin}-${number}`]));
    field.dispatchEvent(new Event("input", { bubbles: true }));
  }

  function draw() {
    for (const element of document.querySelectorAll("[data-part]")) {
      const kind = kinds[element.dataset.part];
      const name = element.dataset.of ?? element.id; // another part's state can be drawn in a second place
      const text = document.querySelector(`[data-state-of="${name}"]`)?.dataset.state;
      if (!kind || text === undefined || drawn.get(element) === text) continue;
      drawn.set(element, text);
      kind(element, JSON.parse(text), sender(name));
    }
  }

  // A child of an element, made when it is first asked for: [tag, class].
  function child(element, key, tag, name) {
    let found = element.querySelector(`:scope > [data-key="${CSS.escape(key)}"]`);
    if (!found) {
      found = document.createElement(tag);
      found.dataset.key = key;
      found.className = name;
      element.append(found);
    }
    return found;
  }

  function write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }

  // viser hears Esc as the emergency stop; unlike an event of a part, it waits for nothing and is never dropped.
  const escape = () =>
    void document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", code: "Escape", bubbles: true }));

  // viser hears no key while a field or a box has the focus: Esc leaves it, and is heard as anywhere else.
  const leave = (event) => {
    if (event.key !== "Escape" || !event.target.matches?.("input, textarea, select")) return;
    event.target.blur();
    escape();
  };
  addEventListener("keydown", leave, true);

  // viser takes what passes the body for a shortcut: a key that presses the button with the focus is none.
  const button = (target) => target.closest?.('button, summary, [role="button"]');
  const presses = ({ target, key }) => [" ", "Enter"].includes(key) && button(target);
  // And what a held key repeats is none either, nor another press of a button; but a held Esc goes on stopping.
  const repeats = (event) => event.repeat && event.key !== "Escape";
  const again = (event) => {
    if (!repeats(event) || !presses(event)) return;
    event.stopImmediatePropagation();
    if (event.key === "Enter") event.preventDefault(); // a button is pressed by each Enter, but by the release of Space
  };
  addEventListener("keydown", again, true);
  document.body.addEventListener("keydown", (event) => (presses(event) || repeats(event)) && event.stopPropagation());
  // A button that a pointer has pressed keeps no focus: the next key is a shortcut, and not its own.
  addEventListener("click", ({ target, detail }) => detail > 0 && button(target)?.blur());

  setInterval(draw, 100);
  return { part: (kind, how) => (kinds[kind] = how), child, write, escape };
})();
