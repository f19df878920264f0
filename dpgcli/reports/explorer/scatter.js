// The scatter of two columns.

const scaleOf = ({ isLog }) => (isLog ? new Bokeh.LogScale() : new Bokeh.LinearScale());

const rangeOf = ({ low, high, isLog }) => {
  const margin = isLog ? (high / low) ** 0.01 : 0.01 * (high - low) || 0.1 * Math.abs(low) || 1;
  return isLog ? [low / margin, high * margin] : [low - margin, high + margin];
};

const axisOf = ({ isLog, label }) => {
  const look = { ...axisLook(), axis_label: plain(label) };
  return isLog ? new Bokeh.LogAxis(look) : new Bokeh.LinearAxis(look);
};

let scatter = null; // its plot and layers

const buildScatter = () => {
  const plot = emptyPlot([rangeOf(chosen.x), rangeOf(chosen.y)], {
    x_scale: scaleOf(chosen.x),
    y_scale: scaleOf(chosen.y),
    outline_line_color: color("text"),
  });
  plot.add_layout(axisOf(chosen.x), "below");
  plot.add_layout(axisOf(chosen.y), "left");
  const marks = (level, marker, size, look) =>
    layer(plot, level, Bokeh.Scatter, ["x", "y"], { marker, size, ...look });
  const filled = (name) => ({ fill_color: color(name), line_color: null });
  const lined = (name, line_width) => ({ fill_color: null, line_color: color(name), line_width });
  marks("glyph", "square", 1.5, filled("faint")).data = { x: chosen.x.finite, y: chosen.y.finite };
  scatter = {
    plot,
    passing: marks("overlay", "square", 4, filled("mark")),
    front: marks("overlay", "diamond", 15, lined("front", 2)),
    selected: marks("overlay", "cross", 20, lined("text", 2.5)),
    box: new Bokeh.BoxAnnotation({
      level: "overlay",
      editable: false,
      fill_color: null,
      line_color: color("text"),
      line_alpha: 1,
      line_dash: [5, 4],
    }),
  };
  plot.add_layout(scatter.box);
  showScatter(plot);
};

const drawScatter = (rows, onFront) => {
  if (!scatter) buildScatter();
  const marked = (some) =>
    Object.fromEntries(
      ["x", "y"].map((axis) => [axis, Float64Array.from(some, (i) => chosen[axis].finite[i])]),
    );
  scatter.passing.data = marked(rows);
  scatter.front.data = marked(onFront);
  scatter.selected.data = marked(selected < 0 ? [] : [selected]);
  const [[left, right], [bottom, top]] = [chosen.x, chosen.y].map((column) =>
    (filters.get(column) ?? [-Infinity, Infinity]).map(column.inside),
  );
  const visible = filters.has(chosen.x) || filters.has(chosen.y);
  scatter.box.setv({ left, right, bottom, top, visible });
};

const brushScatter = (a, b) => {
  filters.set(chosen.x, between(chosen.x, a[0], b[0]));
  if (chosen.x !== chosen.y) filters.set(chosen.y, between(chosen.y, a[1], b[1]));
  redraw();
};

const selectNearest = ([x, y]) => {
  const [across, up] = [chosen.x.place(x), chosen.y.place(y)];
  const { inner_width: width, inner_height: height } = scatter.plot;
  let [nearest, least] = [-1, Infinity];
  for (let i = 0; i < n; i++) {
    const distance = Math.hypot(
      (chosen.x.places[i] - across) * width,
      (chosen.y.places[i] - up) * height,
    );
    if (passes[i] && distance < least) [nearest, least] = [i, distance];
  }
  if (nearest >= 0) select(nearest);
};

const showScatter = stage("scatter", brushScatter, selectNearest);

const MOVES = {
  ArrowRight: ["x", 1],
  ArrowLeft: ["x", -1],
  ArrowUp: ["y", 1],
  ArrowDown: ["y", -1],
};
at("scatter").addEventListener("keydown", (event) => {
  if (!MOVES[event.key]) return;
  event.preventDefault();
  const [axis, step] = MOVES[event.key];
  const { places } = chosen[axis];
  const rows = [];
  for (let i = 0; i < n; i++)
    if (passes[i] && !Number.isNaN(chosen.x.places[i] + chosen.y.places[i])) rows.push(i);
  rows.sort((a, b) => places[a] - places[b] || a - b);
  const here = rows.indexOf(selected);
  if (rows.length)
    select(rows[here < 0 ? 0 : Math.min(rows.length - 1, Math.max(0, here + step))]);
});
