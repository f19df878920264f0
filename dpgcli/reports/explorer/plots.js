// What both plots share: Bokeh's models, and the look of the page. What a brush changes lies on the
// level "overlay", which Bokeh draws on a canvas of its own: what lies below is drawn once.

Bokeh.logger.set_level("warn");
const DRAG = 4; // pixels: less is a click

const color = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const plain = (text) => new Bokeh.PlainText({ text }); // else $$x$$ would be TeX

const lettered = (kind) => ({
  [`${kind}_text_color`]: color("text"),
  [`${kind}_text_font`]: "system-ui, sans-serif",
  [`${kind}_text_font_size`]: "13px",
  [`${kind}_text_font_style`]: "normal",
});

const axisLook = () => ({
  ...lettered("axis_label"),
  ...lettered("major_label"),
  axis_line_color: null,
  major_tick_line_color: color("text"),
  minor_tick_line_color: null,
});

const emptyPlot = (ranges, settings) => {
  const [x_range, y_range] = ranges.map(([start, end]) => new Bokeh.Range1d({ start, end }));
  return new Bokeh.Plot({
    x_range,
    y_range,
    sizing_mode: "stretch_both",
    toolbar_location: null,
    background_fill_color: null,
    border_fill_color: null,
    output_backend: matchMedia("print").matches ? "svg" : "canvas",
    ...settings,
  });
};

// A layer of a plot, and its columns by name: none yet.
const layer = (plot, level, Glyph, fields, look) => {
  const named = Object.fromEntries(fields.map((field) => [field, { field }]));
  const glyph = new Glyph({ ...named, ...look });
  const data_source = new Bokeh.ColumnDataSource({
    data: Object.fromEntries(fields.map((field) => [field, []])),
  });
  // one look, whatever Bokeh holds to be selected
  const looks = { glyph, selection_glyph: glyph, nonselection_glyph: glyph, muted_glyph: glyph };
  plot.add_renderers(new Bokeh.GlyphRenderer({ data_source, level, ...looks }));
  return data_source;
};

// A place of the page for plots, one after the other; gives what shows one. Drags and clicks in it
// are called back in data of the plot: where a drag began and is, where a click was.
const stage = (id, drag, click) => {
  const place = at(id);
  let [views, view, start, last] = [new Map(), null, null, Promise.resolve()];
  const inData = ([x, y]) => [view.frame.x_scale.invert(x), view.frame.y_scale.invert(y)];
  const hasMoved = (end) => Math.hypot(end[0] - start[0], end[1] - start[1]) > DRAG;
  place.addEventListener("pointerdown", ({ offsetX, offsetY, pointerId }) => {
    start = [offsetX, offsetY];
    place.setPointerCapture(pointerId);
  });
  place.addEventListener("pointermove", ({ offsetX, offsetY }) => {
    const end = [offsetX, offsetY];
    if (start && hasMoved(end)) drag(inData(start), inData(end));
  });
  place.addEventListener("pointerup", ({ offsetX, offsetY }) => {
    if (start && !hasMoved([offsetX, offsetY])) click(inData(start));
    start = null;
  });
  const show = async (plot) => {
    views.clear();
    const own = new Bokeh.Document();
    own.add_root(plot);
    views = await Bokeh.embed.add_document_standalone(own, place);
    [view] = views;
    view.el.inert = true; // mouse and focus are the place's
  };
  return (plot) => (last = last.then(() => show(plot)));
};

// What lies between two values of a column; an end of its axis is open.
const between = ({ low, high }, a, b) => {
  const [from, to] = [Math.min(a, b), Math.max(a, b)];
  return [from <= low ? -Infinity : from, to >= high ? Infinity : to];
};
