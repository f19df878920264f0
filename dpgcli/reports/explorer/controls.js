// What is drawn again; lists and fields, and what mouse and keys do.

const MOST_LISTED = 20;

// ---- all of it again, once for all that changes at once

let isWaiting = false;
const redraw = () => {
  if (isWaiting) return;
  isWaiting = true;
  queueMicrotask(draw); // Bokeh waits for the frame
};

const rebuild = () => {
  scatter = parallel = null;
  redraw();
};

const draw = () => {
  isWaiting = false;
  judge();
  const onFront = front();
  const rows = [];
  for (let i = 0; i < n; i++) if (passes[i]) rows.push(i);
  const name = selected < 0 ? "none" : columns[0].values[selected];
  at("count").textContent =
    `${rows.length.toLocaleString("en")} of ${n.toLocaleString("en")} designs pass the filters; ` +
    `${onFront.length.toLocaleString("en")} on the Pareto front. Selected design: ${name}.`;
  at("scatter").setAttribute(
    "aria-label",
    `Scatter of ${chosen.y.label} over ${chosen.x.label}: ${at("count").textContent}`,
  );
  at("parallel").setAttribute(
    "aria-label",
    `Parallel coordinates of ${[...axes].map((c) => c.label).join(", ")}`,
  );
  drawScatter(rows, onFront);
  drawParallel(rows);
  listPassing(rows);
  showFilters();
};

const listPassing = (passing) => {
  const merit = BEST[at("y-best").value];
  const { values } = chosen.y;
  const rows = passing.filter((i) => values[i] !== null);
  rows.sort((a, b) => merit(values[b]) - merit(values[a]) || a - b);
  const some = [columns[0], ...new Set([...columns.filter((c) => c.key), chosen.x, chosen.y])];
  const head = made(
    "tr",
    {},
    ...some.map((c) => made("th", { scope: "col", textContent: c.name })),
  );
  const body = made("tbody");
  for (const i of rows.slice(0, MOST_LISTED)) {
    const button = made("button", { type: "button", textContent: textOf(some[0], i) });
    button.dataset.row = i;
    body.append(
      made(
        "tr",
        {},
        made("td", {}, button),
        ...some.slice(1).map((c) => made("td", { textContent: textOf(c, i) })),
      ),
    );
  }
  const table = at("passing");
  const caption = `The ${Math.min(MOST_LISTED, rows.length)} best of ${rows.length.toLocaleString("en")} by ${chosen.y.name}`;
  table.replaceChildren(made("caption", { textContent: caption }), made("thead", {}, head), body);
};

const showFilters = () => {
  for (const column of columns) {
    if (!column.fields) continue;
    const filter = filters.get(column);
    column.fields.forEach((field, end) => {
      if (field === document.activeElement) return;
      if (column.texts) {
        field.value = filter ? String(filter[0]) : "";
        return;
      }
      field.value =
        filter && Number.isFinite(filter[end]) ? String(Number(filter[end].toPrecision(6))) : "";
      judgeField(field, true);
    });
  }
};

// ---- controls

const filterBy = (column, range) => {
  if (range) filters.set(column, range);
  else filters.delete(column);
  redraw();
};

const judgeField = (field, isNumber) => {
  field.setCustomValidity(isNumber ? "" : "a plain number such as -3.5");
  field.setAttribute("aria-invalid", String(!isNumber));
};

const filterRow = (column) => {
  const cell = (...children) => made("td", {}, ...children);
  const named = (field, what) => {
    field.setAttribute("aria-label", `${column.name}, ${what}`);
    return field;
  };
  if (column.texts) {
    const choice = named(
      made("select", {}, made("option", { value: "", textContent: "any" })),
      "value",
    );
    column.texts.forEach((text, k) =>
      choice.append(made("option", { value: String(k), textContent: text || "(empty)" })),
    );
    choice.addEventListener("change", () =>
      filterBy(column, choice.value === "" ? null : [Number(choice.value), Number(choice.value)]),
    );
    column.fields = [choice];
    return [cell(), cell(choice), cell()];
  }
  column.fields = ["lowest", "highest"].map((what) =>
    named(made("input", { type: "text", inputMode: "decimal" }), what),
  );
  column.fields[0].placeholder = shown(column.low);
  column.fields[1].placeholder = shown(column.high);
  const range = () => {
    const ends = column.fields.map((field, end) => {
      const text = field.value.trim().replace("\u2212", "-"); // the page's own minus sign
      const number = Number(text);
      const isNumber = text === "" || Number.isFinite(number);
      judgeField(field, isNumber);
      return text === "" || !isNumber ? [-Infinity, Infinity][end] : number;
    });
    filterBy(column, ends.some(Number.isFinite) ? ends : null);
  };
  for (const field of column.fields) field.addEventListener("input", range);
  const box = named(
    made("input", { type: "checkbox", checked: axes.has(column) }),
    "axis of the parallel coordinates",
  );
  box.addEventListener("change", () => {
    if (box.checked) axes.add(column);
    else axes.delete(column);
    parallel = null;
    redraw();
  });
  return [cell(box), ...column.fields.map((field) => cell(field))];
};

const buildControls = () => {
  for (const column of columns) {
    const name = made("th", { scope: "row", textContent: column.name });
    const unit = made("td", { textContent: column.unit });
    at("filters").tBodies[0].append(made("tr", {}, name, ...filterRow(column), unit));
  }
  for (const axis of ["x", "y"]) {
    const [choice, best] = [at(axis), at(`${axis}-best`)];
    numbers.forEach((column, k) =>
      choice.append(made("option", { value: String(k), textContent: column.label })),
    );
    Object.keys(BEST).forEach((word) =>
      best.append(made("option", { value: word, textContent: word })),
    );
    const choose = () => {
      chosen[axis] = numbers[Number(choice.value)];
      best.value = chosen[axis].best;
      scatter = null;
      redraw();
    };
    choice.value = String(numbers.indexOf(chosen[axis]));
    choice.addEventListener("change", choose);
    best.addEventListener("change", redraw);
    choose();
  }
  at("clear").addEventListener("click", () => {
    filters.clear();
    redraw();
  });
  at("spec-button").addEventListener("click", () => {
    at("spec").hidden = !at("spec").hidden;
    at("spec-button").setAttribute("aria-expanded", String(!at("spec").hidden));
  });
  document.addEventListener("click", ({ target }) => {
    const { row } = target.dataset ?? {};
    if (row !== undefined) {
      select(Number(row));
      at("title").scrollIntoView({ block: "nearest" });
    }
  });
};

document.querySelectorAll("[data-row]").forEach((button) => (button.hidden = false));
at("shown").textContent = data.shown;
document.getElementById("explorer").hidden = false;
buildControls();
window.addEventListener("resize", () => {
  parallel = null; // its labels are wrapped anew
  redraw();
});
for (const media of ["(prefers-color-scheme: dark)", "print"])
  matchMedia(media).addEventListener("change", rebuild);
select(data.selected);
