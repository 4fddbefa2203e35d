// What moves over a figure with the step: laid over it, so that bokeh need not draw the figure anew.

class Cursor {
  constructor(place, figure) {
    this.place = place;
    this.figure = figure;
    place.classList.add("under");
    for (const [part, kind] of [["seen", "seen"], ["news", "seen"], ["line", "line"], ["point", "point"]]) {
      this[part] = element("div", "", place, `over ${kind}`);
      this[part].style.display = "none";
    }
  }

  // Where the figure's frame lies in its place, in pixels.
  measure() {
    const view = Bokeh.index.find_one(this.figure);
    if (!view || this.place.hidden) { this.frame = null; return; }
    const outer = this.place.getBoundingClientRect(), inner = view.el.getBoundingClientRect(), box = view.frame.bbox;
    this.frame = {left: inner.left - outer.left + box.left, top: inner.top - outer.top + box.top, width: box.width, height: box.height};
  }

  // at: where the step is; seen: from where until where it was seen before, and since; value: the reading, or NaN.
  move(at, seen = null, value = NaN) {
    if (!this.frame) this.measure();
    if (!this.frame) return;
    const {start, end} = this.figure.x_range, {start: low, end: high} = this.figure.y_range, {left, top, width, height} = this.frame;
    const x = v => (v - start) / (end - start) * width, y = v => (1 - (v - low) / (high - low)) * height;
    const within = pixels => pixels >= 0 && pixels <= width;
    put(this.line, within(x(at)), left + x(at), top, 0, height);
    const strip = (part, from, until) => {
      const [a, b] = [from, until].map(v => Math.min(Math.max(x(v), 0), width));
      put(part, b > a, left + a, top, b - a, height);
    };
    if (seen) { strip(this.seen, seen[0], seen[1]); strip(this.news, seen[1], at); }
    const inside = !Number.isNaN(value) && within(x(at)) && y(value) >= 0 && y(value) <= height;
    put(this.point, inside, left + x(at), top + y(value), 0, 0);
  }
}

function put(part, there, left, top, width, height) {
  part.style.display = there ? "" : "none";
  if (!there) return;
  part.style.transform = `translate(${left.toFixed(1)}px, ${top.toFixed(1)}px)`;
  if (width) part.style.width = `${width.toFixed(1)}px`;
  if (height) part.style.height = `${height}px`;
}
