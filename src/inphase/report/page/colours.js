// The colours of day and night, for the page (style.css) and the figures alike.

const RUN_COLOURS = {
  day: ["#0b6e99", "#d1603d", "#3f8f5f", "#6d5aa8", "#a07712", "#8e3b46"],
  night: ["#4fb3de", "#f08a66", "#7cc797", "#ab9be6", "#e0b64c", "#e08a97"],
};
const ROLES = {
  day: {ink: "#22272e", now: "#0b6e99", past: "#c65f45", sent: "#a86f10", pause: "#e9c46a", trouble: "#d1603d"},
  night: {ink: "#e8eaed", now: "#4fb3de", past: "#f08a66", sent: "#e0b64c", pause: "#8a6d1c", trouble: "#a04a33"},
};
const FRAME = {day: {text: "#3d444d", line: "#8b949e", grid: "#e6e9ed"}, night: {text: "#c9d1d9", line: "#6b7580", grid: "#2f363d"}};

function colour_of(role, mode) {
  return role.startsWith("run-") ? RUN_COLOURS[mode][Number(role.slice(4))] : ROLES[mode][role];
}

function paint(figures, mode) {
  document.documentElement.dataset.mode = mode;
  const {text, line, grid} = FRAME[mode];
  for (const figure of figures) {
    figure.setv({background_fill_color: null, border_fill_color: null, outline_line_color: null});
    for (const side of ["left", "below"]) for (const axis of figure[side]) axis.setv({
      axis_line_color: line, major_tick_line_color: line, minor_tick_line_color: null,
      major_label_text_color: text, axis_label_text_color: text,
    });
    for (const model of figure.center) if ("grid_line_color" in model) model.grid_line_color = grid;
    for (const renderer of figure.renderers) {
      const chosen = colour_of(renderer.name, mode), glyph = renderer.glyph, changed = {};
      if ("fill_color" in glyph) changed.fill_color = chosen;
      else changed.line_color = chosen;
      glyph.setv(changed);
    }
  }
}
