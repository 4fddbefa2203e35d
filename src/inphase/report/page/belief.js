// What the filter believed at a step: the cloud, densities, and how readings and weights hang together.

const FIELDS = 60;  // of a density that is drawn

class Belief {
  constructor() {
    const place = name => document.querySelector(`[data-small="${name}"] .drawing`);
    this.cloud = new Scatter(place("cloud"));
    this.phase = new Density(place("phase"));
    this.tempo = new Density(place("tempo"));
    for (const [name, drawing] of [["cloud", this.cloud], ["phase", this.phase], ["tempo", this.tempo]]) beside(drawing, place(name).parentElement);
    this.channels = [];
    this.section = document.getElementById("correlation");
    this.pair = null;
  }

  open(state) {
    const run = state.run;
    this.told = run.has("belief_steps");
    document.querySelector('[data-small="cloud"]').hidden = !this.told;
    this.section.hidden = !this.told;
    if (this.told) {
      this.cloud.open(run.list("demonstrations"), run.numbers("cloud"), run.list("shares"));
      this.matrix(run);
    }
    const place = document.getElementById("densities");
    place.replaceChildren();
    this.channels = state.controlled.map(c => {
      const frame = element("figure", "", place, "plot");
      const {name, unit} = run.controlled[c];
      element("figcaption", unit ? `${name} now [${unit}]` : `${name} now`, frame);
      const density = new Density(element("div", "", frame, "drawing"), 170);
      beside(density, frame);
      return {c, density};
    });
  }

  draw(state) {
    const run = state.run;
    if (!run.steps) return;
    const frame = run.frame("belief_steps", state.step);
    this.moment(run, state.step, frame);
    for (const {c, density} of this.channels) this.channel(run, state.step, c, density);
    if (frame >= 0) {
      this.cloud.draw(run.numbers("cloud").row(frame));
      this.frame = frame;
      this.correlate(run);
    }
  }

  moment(run, step, frame) {
    const phase = run.list("phase")[step], phase_std = run.list("phase_std")[step];
    const velocity = run.list("phase_velocity")[step], velocity_std = run.list("phase_velocity_std")[step];
    const progress = run.has("progress") ? run.list("progress")[step] : NaN;
    const end = run.has("tempos") ? run.list("tempos").at(-1) : 3 * Math.max(velocity, 1e-9);
    const density = (name, low, high, mean, std) => frame >= 0 ? run.numbers(name).row(frame) : gaussian(low, high, mean, std);
    this.phase.draw(0, 1, density("phase_density", 0, 1, phase, phase_std), `${shown(phase)} ± ${shown(phase_std, 2)}`, progress);
    this.tempo.draw(0, end, density("tempo_density", 0, end, velocity, velocity_std), `${shown(velocity)} ± ${shown(velocity_std, 2)}`, run.typical ?? NaN);
  }

  channel(run, step, c, density) {
    const mean = run.column("now", c)[step], std = run.column("now_std", c)[step];
    const [lowest, highest] = run.bounds(c), margin = 0.15 * (highest - lowest) || 1;
    const [low, high] = [lowest - margin, highest + margin];
    const heights = Number.isNaN(mean) ? [] : gaussian(low, high, mean, std);
    density.draw(low, high, heights, `${shown(mean)} ± ${shown(std, 2)}`, run.column("truth", c)[step]);
  }

  // The table of correlations, which is filled at every step.
  matrix(run) {
    const table = this.section.querySelector("table.matrix"), names = run.correlated.map(feature => feature.name);
    this.fields = lay_out(table, names, names);
    this.fields.forEach((row, i) => row.forEach((field, k) => {
      field.tabIndex = 0;
      const open = () => { this.pair = [i, k]; this.weights(run); this.correlate(run); };
      field.onclick = open;
      field.onkeydown = event => { if (event.key === "Enter") open(); };
    }));
    this.pair = null;
    this.drawn = false;
    document.getElementById("weights").hidden = true;
  }

  correlate(run) {
    if (this.drawn && !in_view(this.section)) return;
    this.drawn = true;
    const values = run.numbers("correlation").row(this.frame), n = run.correlated.length;
    let at = 0;
    for (let i = 0; i < n; i++) {
      tint(this.fields[i][i], 1);
      for (let k = i + 1; k < n; k++, at++) {
        tint(this.fields[i][k], values[at] / 127);
        tint(this.fields[k][i], values[at] / 127);
      }
    }
    if (this.pair) this.correlate_weights(run);
  }

  weights(run) {
    const [a, b] = this.pair.map(i => run.correlated[i]), place = document.getElementById("weights");
    place.hidden = false;
    place.querySelector("h3").textContent = `basis weights of ${a.name} (down) and ${b.name} (across)`;
    const numbers = feature => Array.from({length: feature.size}, (_, i) => String(i + 1));
    this.weight_fields = lay_out(place.querySelector("table"), numbers(a), numbers(b));
  }

  // V cov V' for the weights of two features, from the covariance along the few directions.
  correlate_weights(run) {
    const [a, b] = this.pair.map(i => run.correlated[i]);
    const directions = run.numbers("directions"), rank = directions.shape[0], packed = run.numbers("cov").row(this.frame);
    const cov = Array.from({length: rank}, () => new Float64Array(rank));
    for (let i = 0, at = 0; i < rank; i++) for (let k = i; k < rank; k++, at++) cov[i][k] = cov[k][i] = packed[at];
    const vector = (feature, w) => Float64Array.from({length: rank}, (_, r) => directions.at(r * directions.columns + feature.start + w));
    const product = (p, q) => p.reduce((sum, x, i) => sum + x * cov[i].reduce((inner, c, k) => inner + c * q[k], 0), 0);
    const columns = Array.from({length: b.size}, (_, w) => vector(b, w));
    const stds = columns.map(q => Math.sqrt(Math.max(product(q, q), 0)));
    this.weight_fields.forEach((row, w) => {
      const p = vector(a, w), std = Math.sqrt(Math.max(product(p, p), 0));
      row.forEach((field, k) => tint(field, std * stds[k] > 0 ? product(p, columns[k]) / (std * stds[k]) : 0));
    });
  }
}

function beside(drawing, place) {
  drawing.beside = new Beside(place, () => drawing.rows());
}

function gaussian(low, high, mean, std) {
  const width = Math.max(std, 1e-3 * (high - low));
  return Float64Array.from({length: FIELDS}, (_, i) => Math.exp(-0.5 * (((low + (high - low) * i / (FIELDS - 1)) - mean) / width) ** 2));
}

function lay_out(table, down, across) {
  table.replaceChildren();
  const head = element("tr", "", element("thead", "", table));
  element("th", "", head);
  for (const name of across) element("span", name, element("th", "", head));
  const body = element("tbody", "", table);
  return down.map(name => {
    const row = element("tr", "", body);
    element("th", name, row);
    return across.map(() => element("td", "", row));
  });
}

function tint(field, value) {
  const size = Math.abs(value);
  field.style.setProperty("--size", size.toFixed(2));
  field.className = value < 0 ? "negative" : "positive";
  field.textContent = value.toFixed(1).replace("-0.0", "0.0").replace("-", "−");
}
