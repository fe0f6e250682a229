// A row of small buttons. state: [[what, label, enabled], ...]; pressing one sends what.
motiondeck.part("button-row", (element, state, send) => {
  element.replaceChildren(
    ...state.map(([what, label, enabled]) => {
      const button = document.createElement("button");
      button.textContent = label;
      button.disabled = enabled === false;
      button.onclick = () => send(what);
      return button;
    }),
  );
});
