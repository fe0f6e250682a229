// The figures of the loop as a small table. state: {rate, late_p50_us, late_p999_us, work_p50_us, overruns, lock, restarts,
// kept_apart}; of the percentiles null where none is known.
motiondeck.part("loop-figures", (element, state) => {
  const { child, write } = motiondeck;
  const figure = (value, unit) => (value === null ? "-" : `${Math.round(value)}${unit}`);
  const cells = {
    rate: `${state.rate.toFixed(1)} Hz`,
    "late p50 / p99.9": `${figure(state.late_p50_us, "")} / ${figure(state.late_p999_us, " µs")}`,
    "work p50": figure(state.work_p50_us, " µs"),
    lock: state.lock,
    "network restarts": state.restarts || "",
    "limbs kept apart": state.kept_apart ? `${state.kept_apart} times` : "",
  };
  const late = `Late: ${state.overruns} ticks took longer than a period.`;
  write(child(element, "late", "div", ""), state.overruns ? late : "On time: no tick was late.");
  const table = child(element, "cells", "div", "loop-figures");
  for (const [name, value] of Object.entries(cells)) {
    const cell = child(table, name, "div", "");
    cell.hidden = value === "";
    write(child(cell, "name", "small", ""), name);
    write(child(cell, "value", "b", ""), `${value}`);
  }
});

// What the motion looks like, and what is wrong with that. fixed: {unrecognized: words for no motion}
// state: {seen: [name, confidence] or null, mismatch_s, stuck: a joint or ""}
motiondeck.part("recognition", (element, { seen, mismatch_s, stuck }) => {
  const SURE = 0.26; // confidence at which the second expert's error is 1.35 times that of the best one
  const SHOWN_MISMATCH = 0.25; // s for which another motion must be seen before the page says so
  const { child, write } = motiondeck;
  const [name, share] = seen ?? [JSON.parse(element.dataset.fixed).unrecognized, 0];
  const wrong = mismatch_s > SHOWN_MISMATCH;
  write(child(element, "about", "small", ""), "it looks like");
  const line = child(element, "line", "div", "seen-line");
  write(child(line, "name", "b", ""), name);
  write(child(line, "share", "span", ""), `confidence ${share.toFixed(2)}`);
  const bar = child(child(element, "bar", "div", "seen-bar"), "share", "div", "");
  bar.style.width = `${100 * share}%`;
  bar.style.background = `var(--${wrong || stuck ? "fault" : share >= SURE ? "good" : "quiet"})`;
  const said = [wrong ? `not what was commanded, for ${mismatch_s.toFixed(1)} s` : "", stuck ? `${stuck} does not follow` : ""];
  write(child(element, "wrong", "div", "seen-wrong"), said.filter(Boolean).join("; "));
});
