// Tables: of every figure for who cannot see it, of the events, of the run's figures.

const ROWS = 12;

// Below a figure, folded away: what it shows, as numbers; made when it is opened, and at every step while it is.
class Beside {
  constructor(place, rows) {
    this.details = element("details", "", place, "beside");
    element("summary", "as a table", this.details);
    this.table = element("table", "", element("div", "", this.details, "scroll"));
    this.rows = rows;
    this.details.addEventListener("toggle", () => this.draw());
  }

  draw() {
    if (!this.details.open) return;
    const [head, ...rows] = this.rows();
    fill_table(this.table, head, rows);
  }
}

function fill_table(table, head, rows) {
  table.replaceChildren();
  if (head.some(text => text)) {
    const line = element("tr", "", element("thead", "", table));
    for (const text of head) element("th", text, line);
  }
  const body = element("tbody", "", table);
  for (const cells of rows) {
    const line = element("tr", "", body);
    for (const cell of cells) element("td", typeof cell === "number" ? shown(cell) : cell, line);
  }
}

// Evenly many rows of curves, and the present one in its place.
function sampled(count, step) {
  const kept = new Set([Math.min(step, count - 1)]);
  for (let i = 0; i < ROWS; i++) kept.add(Math.round(i * (count - 1) / (ROWS - 1)));
  return [...kept].filter(i => i >= 0 && i < count).sort((a, b) => a - b);
}

function event_rows(run) {
  const told = run.events.map(event => ({
    time: event.time, kind: event.kind,
    says: (event.before || event.after ? `${event.before} → ${event.after}: ` : "") + event.reason,
  }));
  const spells = run.spells.map(spell => ({
    time: spell.start, kind: "status",
    says: `${run.statuses[spell.status].name.toLowerCase().replaceAll("_", " ")} for ${shown(spell.end - spell.start)} s: ${run.statuses[spell.status].says}`,
  }));
  const pauses = run.pauses.map(([start, end]) => ({time: start, kind: "pause", says: `the partner stood still for ${shown(end - start)} s, as was believed`}));
  return [...told, ...spells, ...pauses].sort((a, b) => a.time - b.time);
}

function draw_events(run, go) {
  const table = document.querySelector("#events table"), rows = event_rows(run);
  fill_table(table, ["time [s]", "", "what"], []);
  for (const {time, kind, says} of rows) {
    const line = element("tr", "", table.tBodies[0]);
    const button = element("button", time.toFixed(3), element("td", "", line));
    button.type = "button";
    button.onclick = () => go(time);
    element("td", kind, line);
    element("td", says, line);
  }
  if (!rows.length) element("td", "nothing but following was told", element("tr", "", table.tBodies[0]));
}

function draw_findings(run, go) {
  const section = document.getElementById("findings"), list = section.querySelector("ul");
  list.replaceChildren();
  for (const {says, time, grave} of run.findings) {
    const item = element("li", says, list, grave ? "grave" : "");
    if (time === null) continue;
    const button = element("button", `show ${time.toFixed(2)} s`, item);
    button.type = "button";
    button.onclick = () => go(time);
  }
  section.querySelector(".remarks").replaceChildren(...run.remarks.map(remark => element("p", remark, null, "remark")));
}

function draw_summary(place, tables) {
  place.replaceChildren();
  for (const {title, head, rows, note} of tables) {
    const part = element("div", "", place, head.length > 5 ? "card wide" : "card");
    element("h3", title, part);
    if (rows.length) fill_table(element("table", "", element("div", "", part, "scroll")), head, rows);
    if (note) element("p", note, part, "note");
  }
}
