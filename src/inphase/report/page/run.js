// One run: its description and its numbers, unpacked when they are first asked for.

class Run {
  constructor(description, index) {
    Object.assign(this, description);
    this.index = index;
    this.known = new Map();
  }

  get buffer() {
    if (!this.unpacked) {
      const element = document.getElementById(`numbers-${this.index}`);
      this.unpacked = decode(element.textContent);
      element.remove();
    }
    return this.unpacked;
  }

  has(name) { return name in this.arrays && this.arrays[name].shape[0] > 0; }

  numbers(name) {
    if (!this.known.has(name)) this.known.set(name, new Numbers(this.buffer, this.arrays[name]));
    return this.known.get(name);
  }

  // A plain array of one number each.
  list(name) {
    const key = `${name}|list`;
    if (!this.known.has(key)) {
      const numbers = this.numbers(name);
      this.known.set(key, Float64Array.from({length: numbers.raw.length}, (_, i) => numbers.at(i)));
    }
    return this.known.get(key);
  }

  column(name, k) {
    const key = `${name}|${k}`;
    if (!this.known.has(key)) this.known.set(key, this.numbers(name).column(k));
    return this.known.get(key);
  }

  time(step) { return this.steps ? this.list("step_times")[step] : 0; }

  // The step at a time [s] from the beginning.
  step_at(time) { return last_until(this.list("step_times"), time); }

  // The last frame until a step, of those that are told in full; -1 before the first.
  frame(name, step) {
    if (!this.has(name)) return -1;
    const steps = this.list(name);
    return steps[0] > step ? -1 : last_until(steps, step);
  }

  // Where times stand on the horizontal axis: themselves, or the phase that was believed then.
  across(times, axis) {
    if (axis === "time" || !this.steps) return times;
    const at = this.list("step_times"), phase = this.list("phase");
    return Float64Array.from(times, t => {
      const i = last_until(at, t);
      if (i + 1 >= at.length || t <= at[0]) return phase[t <= at[0] ? 0 : i];
      const share = (t - at[i]) / Math.max(at[i + 1] - at[i], 1e-12);
      return phase[i] + share * (phase[i + 1] - phase[i]);
    });
  }

  // The response that stood at a step: times, phases, mean and deviation of one controlled channel.
  response(frame, k) {
    const times = this.numbers("response_times").row(frame), count = times.length;
    const phases = this.numbers("response_phases").row(frame);
    const mean = this.numbers("response_mean"), std = this.numbers("response_std");
    const found = {times: [], phases: [], mean: [], std: []};
    for (let i = 0; i < count; i++) {
      const place = (frame * count + i) * mean.columns + k, value = mean.at(place);
      if (Number.isNaN(times[i]) || Number.isNaN(value)) continue;
      found.times.push(times[i]);
      found.phases.push(phases[i]);
      found.mean.push(value);
      found.std.push(std.at(place));
    }
    return found;
  }

  // From where to where a controlled channel goes, in what happened and in all responses.
  bounds(c) {
    const ends = ["now", "response_mean", "truth", "commands"].flatMap(name => {
      const {low, span, known} = this.arrays[name];
      return known[c] ? [low[c], low[c] + span[c]] : [];
    });
    if (!ends.length) return [0, 1];
    const band = spread_of(this.column("now_std", c), 0.5, 0.5)[0] ?? 0;  // of most of the bands all is seen
    return [Math.min(...ends) - NINETY * band, Math.max(...ends) + NINETY * band];
  }
}
