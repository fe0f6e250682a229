// Files that are dropped anywhere on the page go to viser's upload button, one after the other.
motiondeck.part("drop-zone", (element, state) => {
  motiondeck.write(element, state);
  if (window.motiondeckDrops) return;
  window.motiondeckDrops = true;
  const mark = (on) => document.body.classList.toggle("file-above", on);
  const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));
  addEventListener("dragover", (event) => (event.preventDefault(), mark(true)));
  addEventListener("dragleave", (event) => event.relatedTarget === null && mark(false));
  addEventListener("drop", async (event) => {
    event.preventDefault();
    mark(false);
    // A skeleton goes before the recording that needs it.
    const files = [...event.dataTransfer.files].sort((a, b) => b.name.endsWith(".asf") - a.name.endsWith(".asf"));
    for (const file of files) {
      const input = document.querySelector("input[type=file]");
      if (!input) return;
      const one = new DataTransfer();
      one.items.add(file);
      input.files = one.files;
      input.dispatchEvent(new Event("change", { bubbles: true }));
      await wait(700);
    }
  });
});
