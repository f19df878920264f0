// The columns of the page's table, their scales, and which designs pass. What the page shows stands
// as JSON in it; nothing is fetched, and text of the data becomes text of the page (textContent) or
// of a canvas, never markup. These files are one script: columns, plots, scatter, parallel, shapes,
// design, controls.
"use strict";

const BEST = { largest: (v) => v, smallest: (v) => -v, "nearest zero": (v) => -Math.abs(v) };

const data = JSON.parse(document.getElementById("explorer-data").textContent);
const { columns, shapes } = data;
const endless = { ".inf": Infinity, "-.inf": -Infinity };
for (const column of columns) {
  column.said = column.values; // as a spec has them
  column.values = column.said.map((value) => endless[value] ?? value);
}
const n = columns[0].values.length;
const columnOf = (name) => columns.find((column) => column.name === name);
const at = (id) => document.getElementById(`explorer-${id}`);
const nStable = columnOf("n_stable").values;
const filters = new Map(); // by column: [lowest, highest]
const axes = new Set(columns.filter((column) => column.is_axis));
const passes = new Uint8Array(n).fill(1);
let selected = -1;
let inverted = []; // units of the large drawing
const chosen = { x: columnOf(data.across), y: columnOf(data.up) };

const numbers = columns.filter((column) => !column.texts);
const shown = (value, digits = 6) =>
  value === null
    ? "–"
    : String(Number(value.toPrecision(digits)))
        .replace("-", "\u2212")
        .replace("Infinity", "∞");
const textOf = (column, row) =>
  column.texts ? column.texts[column.values[row]] : shown(column.values[row]);
const made = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

// ---- scales: where a value is on an axis, 0 to 1; what is infinite lies at its end, as does what
// differences and quotients of doubles do not reach

const FARTHEST = 1e100;
for (const column of numbers) {
  const known = column.values.filter((value) => value !== null && Math.abs(value) <= FARTHEST);
  column.low = known.reduce((a, b) => Math.min(a, b), Infinity);
  column.high = known.reduce((a, b) => Math.max(a, b), -Infinity);
  if (!known.length) [column.low, column.high] = [0, 1];
  column.isLog = column.low > 1 / FARTHEST && column.high > 1000 * column.low;
  const through = column.isLog ? Math.log : (value) => value;
  const start = through(column.low);
  const span = through(column.high) - start;
  column.place = (value) =>
    span === 0 ? 0.5 : Math.min(1, Math.max(0, (through(value) - start) / span));
  column.value = (share) => {
    const value = start + share * span;
    return column.isLog ? Math.exp(value) : value;
  };
  column.inside = (value) => Math.min(column.high, Math.max(column.low, value));
  const each = (place) => Float64Array.from(column.values, (v) => (v === null ? NaN : place(v)));
  column.finite = each(column.inside);
  column.places = each(column.place);
}

// ---- what passes, and the front of it

const judge = () => {
  passes.fill(1);
  for (const [column, [low, high]] of filters) {
    const { values } = column;
    for (let i = 0; i < n; i++) {
      const value = values[i];
      if (value === null || !(value >= low && value <= high)) passes[i] = 0;
    }
  }
};

// Rows of designs with states that no other one beats in one column without losing in the other; ties stay.
const front = () => {
  const merit = ["x", "y"].map((axis) => BEST[at(`${axis}-best`).value]);
  const rows = [];
  for (let i = 0; i < n; i++) {
    if (!passes[i] || !(nStable[i] > 0)) continue;
    if (chosen.x.values[i] === null || chosen.y.values[i] === null) continue;
    rows.push([merit[0](chosen.x.values[i]), merit[1](chosen.y.values[i]), i]);
  }
  rows.sort((a, b) => b[0] - a[0] || b[1] - a[1]);
  const found = [];
  let best = -Infinity;
  let last = null;
  for (const row of rows) {
    const isTie = last && row[0] === last[0] && row[1] === last[1];
    if (row[1] > best || isTie) {
      found.push(row[2]);
      [best, last] = [row[1], row];
    }
  }
  return found;
};
