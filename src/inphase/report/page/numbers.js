// The packed numbers of a run (packing.py), as arrays with a shape.

const KINDS = {u1: Uint8Array, i1: Int8Array, u4: Uint32Array, f4: Float32Array, q2: Uint16Array};
const NINETY = 1.6449;  // deviations on either side that hold nine of ten
const STEPS = 65534, NOTHING = 65535;

function decode(text) {
  const raw = atob(text.trim());
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes.buffer;
}

class Numbers {
  constructor(buffer, {kind, shape, offset, low, span}) {
    const count = shape.reduce((product, length) => product * length, 1);
    this.shape = shape;
    this.columns = shape[shape.length - 1];
    this.raw = new KINDS[kind](buffer, offset, count);
    this.low = low;
    this.span = span;
  }

  // The number at a place in the flat array.
  at(i) {
    const code = this.raw[i];
    if (this.low === undefined) return code;
    const column = i % this.columns;
    return code === NOTHING ? NaN : this.low[column] + this.span[column] * code / STEPS;
  }

  // One of the last columns, whole.
  column(k) {
    const rows = this.columns ? this.raw.length / this.columns : 0;
    const values = new Float64Array(rows);
    for (let i = 0; i < rows; i++) values[i] = this.at(i * this.columns + k);
    return values;
  }

  // The part of the array that belongs to the first index, flat.
  row(i) {
    const length = this.shape.slice(1).reduce((product, n) => product * n, 1);
    return Float64Array.from({length}, (_, k) => this.at(i * length + k));
  }
}

// Where a value would have to be put in an increasing array, less one: the last that is not after it; at least 0.
function last_until(values, wanted) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= wanted) low = middle + 1; else high = middle;
  }
  return Math.max(low - 1, 0);
}

// A curve with no more points than can be told apart between two places: of each stretch the lowest and the highest.
// Only where x increases; a curve over the phase, which may turn back, is drawn as it is, thinned.
function thin(x, y, from, until, most) {
  if (!y.length) return {x: [], y: []};
  const increasing = x.length < 2 || x[x.length - 1] >= x[0];
  if (x.length <= 2 * most) return {x: Array.from(x), y: Array.from(y)};
  let start = 0, end = x.length;
  if (increasing && from !== null) {
    start = Math.max(last_until(x, from) - 1, 0);
    end = Math.min(last_until(x, until) + 2, x.length);
  }
  const xs = [], ys = [];
  const width = Math.max((end - start) / most, 1);
  for (let bin = 0; start + bin * width < end; bin++) {
    const a = Math.floor(start + bin * width), b = Math.min(Math.floor(start + (bin + 1) * width), end);
    let low = -1, high = -1, gap = -1;
    for (let i = a; i < b; i++) {
      if (Number.isNaN(y[i])) { gap = i; continue; }
      if (low < 0 || y[i] < y[low]) low = i;
      if (high < 0 || y[i] > y[high]) high = i;
    }
    const kept = [...new Set([low, high, gap])].filter(i => i >= 0).sort((p, q) => p - q);
    for (const i of kept) { xs.push(x[i]); ys.push(y[i]); }
  }
  return {x: xs, y: ys};
}

function shown(value, digits = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

function in_view(place) {
  const {top, bottom} = place.getBoundingClientRect();
  return bottom > -100 && top < window.innerHeight + 100;
}
