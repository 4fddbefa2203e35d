// The figures over time or phase: what they hold for a run, and what moves with the step.

const MOST = 1500;  // points of a curve that are drawn
const PAST = 8;  // earlier responses

class Plots {
  constructor(runs, slots) {
    this.runs = runs;
    this.slots = slots;
    this.document = Bokeh.documents[0];
    this.figures = [];
    this.cursors = new Map();
    for (const place of document.querySelectorAll("[data-plot]")) {
      const figure = this.document.get_model_by_name(place.dataset.plot);
      this.figures.push(figure);
      this.cursors.set(figure.name, new Cursor(place, figure));
    }
    this.heights = new Map(this.figures.map(({name, height}) => [name, height]));
    this.range = this.document.get_model_by_name("across");
    let waiting = null;
    this.range.change.connect(() => {  // what is looked at more closely is drawn with more points
      clearTimeout(waiting);
      waiting = setTimeout(() => this.redraw(), 120);
      this.remeasure();
    });
    new ResizeObserver(() => this.remeasure()).observe(document.querySelector("main"));
  }

  // After bokeh has laid the figures out anew, the cursors have to be put where they belong.
  remeasure() {
    if (this.measuring) return;
    this.measuring = requestAnimationFrame(() => requestAnimationFrame(() => {
      this.measuring = null;
      for (const cursor of this.cursors.values()) cursor.frame = null;
      if (this.state) this.move(this.state);
    }));
  }

  source(name) { return this.document.get_model_by_name(name); }

  fill(name, data) { this.source(name).data = data; }

  // From where to where the axis goes for all runs.
  reset(state) {
    const length = Math.max(...this.runs.map(run => run.length), 1e-3);
    const [start, end] = state.axis === "time" ? [-0.01 * length, 1.01 * length] : [-0.01, 1.01];
    this.range.setv({start, end, reset_start: start, reset_end: end});
  }

  curve(name, run, times, values) {
    const x = run.across(times, this.state.axis);
    const [from, until] = this.state.axis === "time" ? [this.range.start, this.range.end] : [null, null];
    this.fill(name, thin(x, values, from, until, MOST));
  }

  // The vertical range of a figure, the same at every step.
  fit(name, low, high) {
    const margin = 0.06 * (high - low) || Math.abs(0.1 * low) || 1;
    const [start, end] = [low - margin, high + margin];
    this.source(name).y_range.setv({start, end, reset_start: start, reset_end: end});
  }

  redraw() {
    if (!this.state) return;
    this.still(this.state);
    this.remeasure();
  }

  // All that does not move with the step.
  still(state) {
    this.state = state;
    const run = state.run;
    for (const kind of ["observed", "controlled"]) {  // few channels have more room
      for (let slot = 0; slot < this.slots; slot++) {
        const name = `${kind}-${slot}`;
        this.source(name).height = {1: 320, 2: 230}[state[kind].length] ?? this.heights.get(name);
      }
    }
    for (let slot = 0; slot < this.slots; slot++) {
      const k = state.observed[slot];
      if (k !== undefined) {
        const {low, span} = run.arrays.observed;
        this.fit(`observed-${slot}`, low[k], low[k] + span[k]);
        this.curve(`observed-${slot}:line`, run, run.list("sample_times"), run.column("observed", k));
      }
      const c = state.controlled[slot];
      if (c !== undefined) this.still_controlled(slot, c, run);
    }
    this.course(run);
  }

  still_controlled(slot, c, run) {
    const times = run.list("step_times");
    this.curve(`controlled-${slot}:truth`, run, times, run.column("truth", c));
    const sent = run.column("commands", c);
    this.curve(`controlled-${slot}:sent`, run, run.list("command_times"), sent);
    this.fit(`controlled-${slot}`, ...run.bounds(c));
    if (this.runs.length < 2) return;
    this.fit(`compared-${slot}`, ...run.bounds(c));
    this.curve(`compared-${slot}:truth`, run, times, run.column("truth", c));
    this.runs.forEach((other, i) => {
      const own = other.controlled.findIndex(channel => channel.name === run.controlled[c].name);
      if (own < 0) this.fill(`compared-${slot}:run-${i}`, {x: [], y: []});
      else this.curve(`compared-${slot}:run-${i}`, other, other.list("now_times"), other.column("now", own));
    });
  }

  course(run) {
    const kinds = [["phase", "phase", "phase_std"], ["tempo", "phase_velocity", "phase_velocity_std"], ["likelihood", "log_likelihood", null]];
    for (const [name, values, std] of kinds) {
      this.runs.forEach((other, i) => this.curve(`${name}:run-${i}`, other, other.list("step_times"), other.list(values)));
      if (std) this.band(`${name}:band`, run, run.list(values), run.list(std));
      this.strips(`${name}:pauses`, run, run.pauses);
      const troubled = run.spells.filter(spell => !["FOLLOWING", "FINISHED"].includes(run.statuses[spell.status].name));
      this.strips(`${name}:troubles`, run, troubled.map(spell => [spell.start, spell.end]));
      this.fill(`${name}:events`, {x: Array.from(run.across(run.events.map(event => event.time), this.state.axis))});
    }
    const tempos = this.runs.flatMap(other => spread_of(other.list("phase_velocity"), 0, 0.995));
    const likelihoods = this.runs.flatMap(other => spread_of(other.list("log_likelihood"), 0.01, 0.99));
    this.fit("phase", 0, 1);
    this.fit("tempo", 0, Math.max(...tempos, 1.2 * (run.typical ?? 0), 1e-6));
    if (likelihoods.length) this.fit("likelihood", Math.min(...likelihoods), Math.max(...likelihoods));
    const times = run.list("step_times"), progress = run.list("progress");
    if (progress.length === times.length) this.curve("phase:expected", run, times, progress);
    else this.fill("phase:expected", {x: [], y: []});
    const ends = [0, times.length - 1].filter(i => i >= 0);
    const typical = run.typical ? {x: ends.map(i => run.across([times[i]], this.state.axis)[0]), y: ends.map(() => run.typical)} : {x: [], y: []};
    this.fill("tempo:expected", typical);
  }

  band(name, run, values, std) {
    const low = values.map((v, i) => v - NINETY * std[i]), high = values.map((v, i) => v + NINETY * std[i]);
    const x = run.across(run.list("step_times"), this.state.axis);
    const every = Math.max(Math.ceil(x.length / MOST), 1);
    const kept = values => Array.from(values).filter((_, i) => i % every === 0);
    this.fill(name, {x: kept(x), low: kept(low), high: kept(high)});
  }

  strips(name, run, stretches) {
    const edge = k => Array.from(run.across(stretches.map(stretch => stretch[k]), this.state.axis));
    this.fill(name, {left: edge(0), right: edge(1)});
  }

  // What moves with the step.
  move(state) {
    const run = state.run;
    const time = run.time(state.step);
    const x = run.across([time], state.axis)[0];
    const seen = this.seen(state, run, time);
    const frame = run.frame("frame_steps", state.step);
    for (const [name, cursor] of this.cursors) {
      if (!in_view(cursor.place)) continue;  // what is out of sight follows when it is scrolled to
      const [kind, slot] = name.split("-"), k = state[kind]?.[Number(slot)];
      if (kind === "observed" && k !== undefined) cursor.move(x, seen.across, seen.last < 0 ? NaN : run.column("observed", k)[seen.last]);
      else cursor.move(x, null, kind === "controlled" && k !== undefined ? run.column("now", k)[state.step] ?? NaN : NaN);
      if (kind === "controlled" && k !== undefined) this.answer(slot, k, run, frame, state);
    }
  }

  // From where to where had been seen before this step, and the sample that came with it.
  seen(state, run, time) {
    const samples = run.list("sample_times"), before = state.step > 0 ? run.time(state.step - 1) : time;
    const last = samples.length ? last_until(samples, time + 1e-6) : -1;
    return {last, across: run.across([samples.length ? samples[0] : 0, before], state.axis)};
  }

  // The response that stood at the step, and some before it.
  answer(slot, c, run, frame, state) {
    const name = part => `controlled-${slot}:${part}`;
    const steps = run.has("frame_steps") ? run.list("frame_steps") : [];
    const past = {xs: [], ys: []};
    const across = response => state.axis === "time" ? response.times : response.phases;
    if (frame < 0) {
      this.fill(name("response"), {x: [], y: []});
      this.fill(name("band"), {x: [], low: [], high: []});
    } else {
      const response = run.response(frame, c);
      this.fill(name("response"), {x: across(response), y: response.mean});
      const off = sign => response.mean.map((mean, i) => mean + sign * NINETY * response.std[i]);
      this.fill(name("band"), {x: across(response), low: off(-1), high: off(1)});
      const every = Math.max(Math.round(steps.length / 25), 1);
      for (let i = 1; i <= PAST; i++) {
        const earlier = (Math.ceil(frame / every) - i) * every;
        if (earlier < 0) break;
        const response = run.response(earlier, c);
        past.xs.push(across(response));
        past.ys.push(response.mean);
      }
    }
    this.fill(name("past"), past);
  }
}

// The quantiles of what is finite, as a pair; nothing where nothing is.
function spread_of(values, low, high) {
  const sorted = Float64Array.from(values).filter(Number.isFinite).sort();
  return sorted.length ? [low, high].map(share => sorted[Math.round(share * (sorted.length - 1))]) : [];
}
