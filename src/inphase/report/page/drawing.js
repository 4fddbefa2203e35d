// Small pictures of one moment, drawn anew at every step: densities and the cloud of the weights, as SVG.

const SVG = "http://www.w3.org/2000/svg";

function svg(tag, attributes, parent) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (parent) parent.append(element);
  return element;
}

function element(tag, text = "", parent = null, kind = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (kind) made.className = kind;
  if (parent) parent.append(made);
  return made;
}

// A density over a line, with the mean and where 90 % lie, in words below.
class Density {
  constructor(place, width = 300) {
    this.width = width;
    this.root = svg("svg", {viewBox: `0 0 ${width} 70`, class: "density", role: "img"}, place);
    this.area = svg("path", {class: "area"}, this.root);
    this.mark = svg("line", {class: "mark", y1: 4, y2: 58}, this.root);
    svg("line", {class: "axis", x1: 0, x2: width, y1: 58, y2: 58}, this.root);
    this.ends = ["start", "end"].map((anchor, i) => svg("text", {x: width * i, y: 69, "text-anchor": anchor}, this.root));
    this.centre = svg("text", {x: width / 2, y: 69, "text-anchor": "middle", class: "centre"}, this.root);
  }

  // heights: at evenly spaced places from `low` to `high`; truth: what it really was, or NaN.
  draw(low, high, heights, words, truth = NaN) {
    const most = Math.max(...heights, 1e-300), n = heights.length, width = this.width;
    const points = Array.from(heights, (h, i) => `${(width * i / (n - 1)).toFixed(1)},${(58 - 52 * h / most).toFixed(1)}`);
    this.area.setAttribute("d", n ? `M0,58 L${points.join(" L")} L${width},58 Z` : "");
    const at = width * (truth - low) / (high - low);
    this.mark.style.display = Number.isFinite(at) && at >= 0 && at <= width ? "" : "none";
    if (Number.isFinite(at)) { this.mark.setAttribute("x1", at); this.mark.setAttribute("x2", at); }
    [low, high].forEach((end, i) => { this.ends[i].textContent = shown(end); });
    this.centre.textContent = words;
    this.root.setAttribute("aria-label", words);
    this.drawn = {low, high, heights, truth};
    this.beside?.draw();
  }

  // What the table beside it holds: where a share of the density lies below.
  rows() {
    if (!this.drawn) return [["nothing yet"]];
    const {low, high, heights, truth} = this.drawn, total = heights.reduce((sum, h) => sum + h, 0);
    const below = share => {
      let sum = 0;
      const i = heights.findIndex(h => (sum += h) >= share * total);
      return total > 0 ? low + (high - low) * i / (heights.length - 1) : NaN;
    };
    return [["share below", "at"], ...[0.05, 0.25, 0.5, 0.75, 0.95].map(share => [`${100 * share} %`, below(share)]), ["true or typical", truth]];
  }
}

// The cloud of the weights among the demonstrations, seen along two fixed axes.
class Scatter {
  constructor(place) {
    this.root = svg("svg", {viewBox: "0 0 300 210", class: "cloud", role: "img", "aria-label": "weights on two principal components"}, place);
    this.fixed = svg("g", {class: "demonstrations"}, this.root);
    this.moving = svg("g", {class: "points"}, this.root);
    this.words = [svg("text", {x: 298, y: 206, "text-anchor": "end"}, this.root), svg("text", {x: 2, y: 12}, this.root)];
  }

  // demonstrations, clouds: flat x, y, x, y, …; the axes hold all of both.
  open(demonstrations, clouds, shares) {
    this.demonstrations = demonstrations;
    let reach = 1e-12;
    for (const value of demonstrations) reach = Math.max(reach, Math.abs(value));
    for (let i = 0; i < clouds.raw.length; i += 7) reach = Math.max(reach, Math.abs(clouds.at(i)));
    this.scale = 100 / reach;
    this.fixed.replaceChildren();
    for (let i = 0; i < demonstrations.length; i += 2) {
      const [x, y] = this.place(demonstrations[i], demonstrations[i + 1]);
      svg("path", {d: `M${x - 3},${y} h6 M${x},${y - 3} v6`}, this.fixed);
    }
    this.words[0].textContent = `1st: ${shown(100 * shares[0], 2)} % →`;
    this.words[1].textContent = `↑ 2nd: ${shown(100 * shares[1], 2)} %`;
  }

  place(x, y) { return [150 + 1.45 * this.scale * x, 105 - this.scale * y]; }

  draw(points) {
    while (this.moving.childElementCount < points.length / 2) svg("circle", {r: 2.6}, this.moving);
    const circles = this.moving.children;
    for (let i = 0; i < points.length / 2; i++) {
      const [x, y] = this.place(points[2 * i], points[2 * i + 1]);
      circles[i].setAttribute("cx", x.toFixed(1));
      circles[i].setAttribute("cy", y.toFixed(1));
    }
    this.drawn = points;
    this.beside?.draw();
  }

  // What the table beside it holds: where the cloud is and how wide, and the demonstrations.
  rows() {
    const moments = (values, axis) => {
      const own = Array.from(values ?? []).filter((_, i) => i % 2 === axis), mean = own.reduce((sum, v) => sum + v, 0) / own.length;
      return [mean, Math.sqrt(own.reduce((sum, v) => sum + (v - mean) ** 2, 0) / own.length)];
    };
    return [["", "1st", "±", "2nd", "±"], ...[["belief", this.drawn], ["demonstrations", this.demonstrations]].map(([name, values]) => [name, ...moments(values, 0), ...moments(values, 1)])];
  }
}
