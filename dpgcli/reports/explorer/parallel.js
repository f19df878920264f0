// The parallel coordinates: a line for each design, between axes from 0 to 1.

const MOST_LINES = 1500; // more are a surface, and take longer than a frame
const LETTER = 7; // mean width of a letter, in pixels
const SIDE = 70; // of a label beside the first and the last axis

const wrapped = (text, width) => {
  const lines = [""];
  for (const word of text.split(/(?<=[ .])/)) {
    const joined = lines.at(-1) + word;
    if (!lines.at(-1) || joined.trim().length * LETTER <= Math.max(60, width))
      lines[lines.length - 1] = joined;
    else lines.push(word);
  }
  return lines.join("\n");
};

let parallel = null; // its layers, and the columns of its axes

const buildParallel = () => {
  const list = [...axes];
  const last = Math.max(1, list.length - 1);
  const plot = emptyPlot([[0, last], [0, 1]], {
    outline_line_color: null,
    min_border_left: SIDE,
    min_border_right: SIDE,
  });
  const step = (at("parallel").clientWidth - 2 * SIDE) / last;
  const ticks = list.map((_, k) => k);
  const axis = (texts, side) =>
    plot.add_layout(
      new Bokeh.LinearAxis({
        ...axisLook(),
        ticker: new Bokeh.FixedTicker({ ticks }),
        major_label_overrides: new Map(texts.map((text, k) => [k, plain(text)])),
        major_tick_line_color: null,
      }),
      side,
    );
  axis(list.map((c) => `${wrapped(c.label, step - 8)}\n${shown(c.high)}`), "above");
  axis(list.map((c) => shown(c.low)), "below");
  const drawn = (name, Glyph, fields, look) =>
    layer(plot, "overlay", Glyph, fields, { line_color: color(name), ...look });
  const [lines, thick] = [
    drawn("mark", Bokeh.MultiLine, ["xs", "ys", "line_alpha"]),
    drawn("text", Bokeh.MultiLine, ["xs", "ys"], { line_width: 3 }),
  ];
  drawn("text", Bokeh.Segment, ["x0", "x1"], { y0: 0, y1: 1 }).data = { x0: ticks, x1: ticks };
  const ranges = drawn("text", Bokeh.Rect, ["x", "y", "height"], {
    width: { value: 12, units: "screen" },
    fill_color: null,
    line_width: 3,
  });
  parallel = { lines, thick, ranges, list };
  showParallel(plot);
};

const drawParallel = (rows) => {
  if (!parallel) buildParallel();
  const { list } = parallel;
  const across = Float64Array.from(list.keys());
  const paths = (some) => ({
    xs: some.map(() => across),
    ys: some.map((i) => Float64Array.from(list, ({ places }) => places[i])),
  });
  const every = Math.max(1, Math.ceil(rows.length / MOST_LINES));
  const some = rows.filter((_, k) => k % every === 0);
  const alpha = Math.max(0.12, Math.min(0.8, 60 / some.length));
  parallel.lines.data = { ...paths(some), line_alpha: new Float64Array(some.length).fill(alpha) };
  parallel.thick.data = paths(selected < 0 ? [] : [selected]);
  const filtered = [...list.keys()].filter((k) => filters.has(list[k]));
  const ends = filtered.map((k) => filters.get(list[k]).map(list[k].place));
  parallel.ranges.data = {
    x: filtered,
    y: ends.map(([low, high]) => (low + high) / 2),
    height: ends.map(([low, high]) => Math.max(0.005, high - low)),
  };
  const share = every > 1 ? `One line in ${every} is drawn.` : "";
  at("lines").textContent =
    `A line for each design that passes; the thick one is the selected design. ${share}`;
};

const filterAxis = (x, range) => {
  const { list } = parallel;
  const column = list[Math.max(0, Math.min(list.length - 1, Math.round(x)))];
  if (column) filterBy(column, range(column));
};

const showParallel = stage(
  "parallel",
  ([x, a], [, b]) => filterAxis(x, (column) => between(column, column.value(a), column.value(b))),
  ([x]) => filterAxis(x, () => null),
);
