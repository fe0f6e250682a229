// Which of two views this browser shows, whether it is dark, and whether it is locked against touch: by browser, never by
// the server. The address says the view (?view=operate or inspect), else what was chosen here before, else a phone or what
// is touched opens in operate. Elements with data-in="operate" or "inspect" are hidden in the other view. Whoever draws for
// one view alone reads document.documentElement.dataset.view, and hears "motiondeck-view" when view or colours change.
motiondeck.browser ??= (() => {
  const root = document.documentElement;
  const asked = new URLSearchParams(location.search).get("view");
  const hand = matchMedia("(max-width: 640px), (pointer: coarse)").matches;
  const night = matchMedia("(prefers-color-scheme: dark)");
  const chosen = {};
  const kept = (name) => {
    try {
      return chosen[name] ?? localStorage.getItem(`motiondeck-${name}`);
    } catch {
      return null; // a browser that keeps nothing
    }
  };
  let known = false; // whether this page has both views

  function update() {
    const bar = document.querySelector(".view-switches");
    const scene = bar && document.querySelector("canvas")?.getBoundingClientRect();
    if (scene && root.dataset.view !== "operate") { // what stands over the scene is between the panels, however wide they are
      root.style.setProperty("--scene-left", `${scene.left}px`);
      root.style.setProperty("--scene-right", `${innerWidth - scene.right}px`);
    }
    known ||= Boolean(document.querySelector('[data-part="operate"]'));
    const locked = known && kept("locked") === "yes";
    const view = [chosen.view, asked, kept("view"), hand ? "operate" : ""].find((one) => ["operate", "inspect"].includes(one));
    const now = { view: known && (locked || view === "operate") ? "operate" : "inspect", locked: String(locked) };
    now.scheme = known && (kept("scheme") ?? (night.matches ? "dark" : "light")) === "dark" ? "dark" : "light";
    if (!Object.entries(now).some(([name, value]) => root.dataset[name] !== value)) return;
    Object.assign(root.dataset, now);
    dispatchEvent(new Event("motiondeck-view"));
  }

  // Chooses "view", "scheme" or "locked"; the address keeps to what was chosen.
  function choose(name, value) {
    chosen[name] = value;
    try {
      localStorage.setItem(`motiondeck-${name}`, value);
    } catch {} // then until the page is closed
    const address = new URL(location.href);
    if (name === "view" && asked) history.replaceState(null, "", (address.searchParams.set("view", value), address));
    update();
  }

  // The buttons for the other view and the other colours.
  function switches(parent) {
    const { child, write } = motiondeck;
    const [view, scheme] = ["view", "scheme"].map((name) => child(parent, name, "button", ""));
    const { view: shown, scheme: colours } = root.dataset;
    write(view, shown === "operate" ? "Inspect" : "Operate");
    view.title = shown === "operate" ? "The view with all figures" : "The view for a phone or a stage";
    view.onclick = () => choose("view", shown === "operate" ? "inspect" : "operate");
    write(scheme, colours === "dark" ? "Light" : "Dark");
    scheme.title = `${scheme.textContent} colours in this browser`;
    scheme.onclick = () => choose("scheme", colours === "dark" ? "light" : "dark");
  }

  // viser names some of its widgets for no screen reader: they have the name of the line they stand in.
  function name() {
    for (const field of document.querySelectorAll('#root input:not([aria-label]):not([type="hidden"]), #root [role="slider"][aria-label=""]')) {
      if (field.labels?.length) continue;
      for (let box = field.parentElement; box && box.id !== "root"; box = box.parentElement) {
        const label = box.querySelector("label[for]");
        if (label) field.setAttribute("aria-label", label.textContent);
        if (label) break;
      }
    }
    const icons = document.querySelectorAll("#root .mantine-ActionIcon-root:not([aria-label])");
    document.querySelector("#root .mantine-Notification-closeButton:not([aria-label])")?.setAttribute("aria-label", "Dismiss");
    icons.forEach((icon, place) => icon.setAttribute("aria-label", ["Commands", "Settings of the view"][place] ?? "more"));
  }

  // viser's folders open by a click alone: here by Tab and Enter or Space, too.
  function reach() {
    for (const head of document.querySelectorAll('#root .mantine-Paper-root > .mantine-Paper-root[style*="cursor: pointer"]')) {
      head.ariaExpanded = String((head.nextElementSibling?.offsetHeight ?? 0) > 0);
      if (head.role === "button") continue;
      Object.assign(head, { tabIndex: 0, role: "button" });
      head.addEventListener("keydown", (event) => {
        if (event.target !== head || !["Enter", " "].includes(event.key)) return;
        event.preventDefault();
        event.stopPropagation(); // Space pauses elsewhere
        head.click();
      });
    }
  }

  setInterval(update, 100);
  setInterval(() => (name(), reach()), 500);
  return { update, choose, switches };
})();

// Over a corner of the scene, in inspect. sends {dark, whole}: viser's widgets and the scene follow the colours, and the
// camera whether the scene is seen as a whole, or behind a phone's sheet
motiondeck.part("views", (element, state, send) => {
  const root = document.documentElement;
  const bar = motiondeck.child(document.body, "views", "nav", "view-switches");
  bar.dataset.in = "inspect";
  bar.setAttribute("aria-label", "view");
  const sheet = matchMedia("(max-width: 575px)"); // viser's panels are one sheet over the lower half
  let told = JSON.stringify({ dark: false, whole: false });
  const show = () => {
    if (bar.hasChildNodes() || document.querySelector('[data-part="operate"]')) motiondeck.browser.switches(bar);
    const now = { dark: root.dataset.scheme === "dark", whole: root.dataset.view === "operate" || !sheet.matches };
    if (told !== JSON.stringify(now)) send(now);
    told = JSON.stringify(now);
  };
  removeEventListener("motiondeck-view", element.ownerDocument.motiondeckViews);
  addEventListener("motiondeck-view", (document.motiondeckViews = show));
  motiondeck.browser.update();
  show();
});
