// Files that are dropped anywhere on the page go to viser's upload button, one after the other.
motiondeck.part("drop-zone", (element, state) => motiondeck.write(element, state));

window.motiondeckDrops ??= (() => {
  const mark = (on) => document.body.classList.toggle("file-above", on);
  const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

  // The button is on the page once its tab has been open; a tab of viser's listens to keys and pointers, not to clicks.
  async function uploadButton() {
    const tab = [...document.querySelectorAll("[role=tab]")].find((tab) => tab.textContent.trim() === "Learn");
    tab?.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    for (let tries = 0; tries < 100; tries += 1) {
      const input = document.querySelector("input[type=file]");
      if (input || !tab) return input;
      await wait(50);
    }
    return null;
  }

  addEventListener("dragover", (event) => (event.preventDefault(), mark(event.dataTransfer.types.includes("Files"))));
  addEventListener("dragleave", (event) => event.relatedTarget === null && mark(false));
  addEventListener("drop", async (event) => {
    event.preventDefault();
    mark(false);
    // A skeleton goes before the recording that needs it.
    const files = [...event.dataTransfer.files].sort((a, b) => b.name.endsWith(".asf") - a.name.endsWith(".asf"));
    for (const file of files) {
      const input = await uploadButton();
      if (!input) return;
      const one = new DataTransfer();
      one.items.add(file);
      input.files = one.files;
      input.dispatchEvent(new Event("change", { bubbles: true }));
      await wait(700);
    }
  });
  return true;
})();
