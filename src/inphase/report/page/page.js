// The page: one state, and all that follows it.

const {runs: described, slots} = JSON.parse(document.getElementById("runs").textContent);
const runs = described.map((description, i) => new Run(description, i));
const by_id = id => document.getElementById(id);
const state = {run: runs[0], step: 0, axis: "time", observed: [], controlled: [], playing: null};
let plots, belief, tables = [], pending = false;

function start() {
  plots = new Plots(runs, slots);
  belief = new Belief();
  const night = window.matchMedia("(prefers-color-scheme: dark)");
  const colour = mode => { paint(plots.figures, mode); by_id("night").setAttribute("aria-pressed", String(mode === "night")); };
  colour(night.matches ? "night" : "day");
  night.addEventListener("change", () => colour(night.matches ? "night" : "day"));
  by_id("night").onclick = () => colour(document.documentElement.dataset.mode === "night" ? "day" : "night");
  choose_runs();
  listen();
  open_run(runs[0]);
  document.documentElement.dataset.ready = "true";
}

function choose_runs() {
  const select = by_id("run");
  runs.forEach((run, i) => { const option = element("option", label(run), select); option.value = i; });
  select.closest("label").hidden = runs.length < 2;
  select.onchange = () => open_run(runs[Number(select.value)]);
  if (runs.length < 2) return;
  by_id("compared").hidden = false;
  for (const place of document.querySelectorAll("#compared .legend, #course-legend")) {
    runs.forEach((run, i) => { element("span", label(run), place, `run-${i}`); });
    if (place.id !== "course-legend") element("span", "what happened", place, "ink");
  }
}

function label(run) { return run.filter ? `${run.title} (${run.filter})` : run.title; }

function open_run(run) {
  const time = state.run.time(state.step);
  state.run = run;
  state.observed = first(run.observed, run.arrays.observed);
  state.controlled = first(run.controlled, run.arrays.truth, run.arrays.now);
  const slider = by_id("step");
  slider.max = Math.max(run.steps - 1, 0);
  choosers(run);
  frames(run);
  draw_findings(run, go);
  draw_events(run, go);
  draw_summary(document.querySelector("#summary .tables"), run.summary);
  if (runs.length > 1) draw_summary(document.querySelector("#compared .tables"), compared());
  draw_course_legend(run);
  document.querySelector("#controlled .legend .sent").hidden = !run.has("command_times");
  document.querySelector("#controlled .legend .ink").hidden = !run.has("truth");
  plots.state = state;
  plots.reset(state);
  redraw();
  set_step(run.steps ? run.step_at(time) : 0);
}

// Those that move most, by the range in which they were packed: of a group the first would be alike.
function first(channels, ...arrays) {
  const spans = channels.map((_, k) => Math.max(...arrays.map(array => array.known[k] ? array.span[k] : 0)));
  const by_unit = new Map();
  channels.forEach(({unit, group}, k) => { const key = `${group}|${unit}`; by_unit.set(key, Math.max(by_unit.get(key) ?? 0, spans[k])); });
  const relative = channels.map(({unit, group}, k) => spans[k] / (by_unit.get(`${group}|${unit}`) || 1));
  const order = channels.map((_, k) => k).sort((a, b) => relative[b] - relative[a] || a - b);
  return order.slice(0, slots).sort((a, b) => a - b);
}

function choosers(run) {
  for (const kind of ["observed", "controlled"]) {
    const section = by_id(kind), channels = run[kind], left_out = run.left_out[kind];
    const most = Math.min(slots, channels.length);
    section.querySelector("small").textContent = channels.length > most ? `${most} of ${channels.length + left_out} channels` : "";
    const details = section.querySelector(".chooser"), place = details.querySelector("div");
    details.hidden = channels.length <= most;
    place.replaceChildren();
    for (let slot = 0; slot < most; slot++) {
      const select = element("select", "", element("label", `${slot + 1} `, place));
      channels.forEach(({name}, k) => { const option = element("option", name, select); option.value = k; });
      select.value = state[kind][slot];
      select.onchange = () => { state[kind][slot] = Number(select.value); frames(run); redraw(); draw(); };
    }
    if (left_out) element("p", `${left_out} more are not in this page; --channels takes others`, place, "note");
  }
}

// Headings and tables of the figures; those without a channel are not there.
function frames(run) {
  tables = [];
  const t = step => run.time(step);
  for (const place of document.querySelectorAll("[data-plot]")) {
    const [kind, slot] = place.dataset.plot.split("-");
    place.querySelector("details.beside")?.remove();
    if (slot !== undefined) {
      const role = kind === "observed" ? "observed" : "controlled", k = state[role][Number(slot)];
      place.hidden = k === undefined;
      if (k === undefined) continue;
      const {name, unit} = run[role][k];
      place.querySelector("figcaption").textContent = unit ? `${name} [${unit}]` : name;
      tables.push(new Beside(place, rows_of(kind, run, k)));
    } else {
      const name = {phase: "phase", tempo: "phase_velocity", likelihood: "log_likelihood"}[kind];
      const std = kind === "likelihood" ? null : `${name}_std`;
      tables.push(new Beside(place, () => [
        ["time [s]", kind, ...(std ? ["±"] : []), "status"],
        ...sampled(run.steps, state.step).map(i => [
          t(i), run.list(name)[i], ...(std ? [run.list(std)[i]] : []), run.statuses[run.list("status")[i]].name.toLowerCase().replaceAll("_", " "),
        ]),
      ]));
    }
  }
  belief.open(state);
}

function rows_of(kind, run, k) {
  if (kind === "observed") return () => {
    const times = run.list("sample_times"), values = run.column("observed", k);
    return [["time [s]", "reading"], ...sampled(times.length, last_until(times, run.time(state.step))).map(i => [times[i], values[i]])];
  };
  if (kind === "compared") return () => {
    const steps = sampled(run.steps, state.step), name = run.controlled[k].name;
    const own = runs.map(other => other.controlled.findIndex(channel => channel.name === name));
    const value = (other, i, time) => own[i] < 0 || !other.steps ? NaN : other.column("now", own[i])[other.step_at(time)];
    return [["time [s]", "happened", ...runs.map(label)], ...steps.map(s => [run.time(s), run.column("truth", k)[s], ...runs.map((other, i) => value(other, i, run.time(s)))])];
  };
  return () => {
    const frame = run.frame("frame_steps", state.step);
    if (frame < 0) return [["no response yet"]];
    const {times, phases, mean, std} = run.response(frame, k), truth = run.column("truth", k);
    const every = Math.max(Math.floor(times.length / ROWS), 1);
    return [["time [s]", "phase", "response", "90 % ±", "happened"], ...times.map((time, i) => [time, phases[i], mean[i], NINETY * std[i], time <= run.length ? truth[run.step_at(time)] : NaN]).filter((_, i) => i % every === 0)];
  };
}

function draw_course_legend(run) {
  const place = by_id("course-legend");
  if (runs.length < 2) {
    place.replaceChildren();
    element("span", "believed, 90 % band", place, "now");
  } else place.querySelectorAll(".extra").forEach(old => old.remove());
  const add = (text, kind) => element("span", text, place, `${kind} extra`);
  if (run.has("progress")) add("share of the time that had passed; the typical tempo", "ink dotted");
  else if (run.typical) add("the typical tempo", "ink dotted");
  if (run.pauses.length) add("pause", "pause block");
  if (run.spells.some(spell => !["FOLLOWING", "FINISHED"].includes(run.statuses[spell.status].name))) add("not simply following", "trouble block");
  if (run.events.length) add("event", "sent dotted");
}

function compared() {
  const titles = new Set(["Response now", "Foresight and timing"]);
  const parts = runs.map(run => run.summary.filter(table => titles.has(table.title)));
  const line = (run, i) => {
    const [now, then] = [parts[i].find(t => t.title === "Response now"), parts[i].find(t => t.title === "Foresight and timing")];
    return [label(run), ...(now ? now.rows[0].slice(3) : ["–", "–"]), ...(then ? then.rows.map(row => row[1]) : [])];
  };
  const then = parts.flat().find(t => t.title === "Foresight and timing");
  return [{title: "Side by side", head: ["run", "error", "inside 90 %", ...(then ? then.rows.map(row => row[0]) : [])], rows: runs.map(line), note: ""}];
}

function listen() {
  by_id("step").oninput = event => set_step(Number(event.target.value));
  by_id("back").onclick = () => set_step(state.step - 1);
  by_id("forth").onclick = () => set_step(state.step + 1);
  by_id("play").onclick = () => play(state.playing === null);
  by_id("axis").onchange = event => { state.axis = event.target.value; plots.reset(state); redraw(); draw(); };
  document.addEventListener("keydown", event => {
    if (event.target.closest("select, input:not([type=range]), textarea, [contenteditable]") || event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? 10 : 1;
    const keys = {ArrowLeft: () => set_step(state.step - far), ArrowRight: () => set_step(state.step + far), Home: () => set_step(0), End: () => set_step(state.run.steps - 1)};
    const pressed = event.key === " " && !event.target.closest("button, summary, td") ? () => play(state.playing === null) : keys[event.key];
    if (!pressed) return;
    event.preventDefault();
    pressed();
  });
  let scrolled = false;
  window.addEventListener("scroll", () => {
    if (scrolled) return;
    scrolled = true;
    requestAnimationFrame(() => { scrolled = false; draw(); });
  }, {passive: true});
}

function go(time) {
  set_step(state.run.step_at(time));
}

function set_step(step) {
  state.step = Math.min(Math.max(step, 0), Math.max(state.run.steps - 1, 0));
  by_id("step").value = state.step;
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => { pending = false; draw(); });
}

function redraw() { plots.still(state); }

function draw() {
  const run = state.run;
  if (run.steps) {
    plots.move(state);
    belief.draw(state);
    for (const table of tables) table.draw();
  }
  const status = run.steps ? run.statuses[run.list("status")[state.step]] : null;
  by_id("moment").textContent = run.steps ? `${run.time(state.step).toFixed(3)} of ${run.length.toFixed(2)} s, step ${state.step + 1} of ${run.steps}` : "no steps";
  by_id("state").textContent = status ? `phase ${run.list("phase")[state.step].toFixed(3)} ± ${run.list("phase_std")[state.step].toFixed(3)} · tempo ${shown(run.list("phase_velocity")[state.step])} /s · ${status.says}` : "nothing was inferred in this run";
  by_id("state").className = status && !status.fine ? "grave" : "";
  document.documentElement.dataset.step = state.step;
}

function play(on) {
  by_id("play").textContent = on ? "❚❚ stop" : "▶ play";
  if (!on) { cancelAnimationFrame(state.playing); state.playing = null; return; }
  const run = state.run;
  if (state.step >= run.steps - 1) set_step(0);
  let at = run.time(state.step), before = performance.now();
  const tick = now => {
    at += (now - before) / 1000 * Number(by_id("speed").value);
    before = now;
    set_step(run.step_at(at));
    if (at >= run.length || state.run !== run) play(false); else state.playing = requestAnimationFrame(tick);
  };
  state.playing = requestAnimationFrame(tick);
}

// bokeh builds its figures a moment after its script has run
function when_ready() {
  if (Bokeh.documents.length && Bokeh.documents[0].is_idle) start(); else setTimeout(when_ready, 10);
}
when_ready();
