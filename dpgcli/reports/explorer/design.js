// The selected design: its states, numbers and spec.

const shapeOf = (row) => {
  const place = shapes.places[row];
  if (place < 0) return null;
  const own = Object.fromEntries(
    Object.entries(shapes.values).map(([key, values]) => [key, values[place]]),
  );
  return { ...shapes.same, ...own, others: shapes.others[place] || {} };
};

const drawLarge = (shape, view) => {
  const digits = inverted.join("");
  const said = `${digits}: ${describe(shape, inverted)}`;
  at("large").replaceChildren(...drawn(shape, inverted, view, said));
  at("units")
    .querySelectorAll("button")
    .forEach((button, unit) => {
      button.setAttribute("aria-pressed", String(Boolean(inverted[unit])));
    });
};

const drawStates = () => {
  const shape = shapeOf(selected);
  for (const id of ["units", "large", "states"]) at(id).replaceChildren();
  at("states-note").textContent = shape
    ? shapes.note
    : shapes.reasons[-1 - shapes.places[selected]];
  if (!shape) return;
  const nUnits = shape.units;
  const view = windowOf(shape, nUnits);
  inverted = Array(nUnits).fill(1);
  for (let unit = 0; unit < nUnits; unit++) {
    const button = made("button", { type: "button", textContent: `unit ${unit + 1}` });
    button.addEventListener("click", () => {
      inverted[unit] = 1 - inverted[unit];
      drawLarge(shape, view);
    });
    at("units").append(button, " ");
  }
  drawLarge(shape, view);
  if (2 ** nUnits > MOST_STATES) return;
  for (const pattern of patternsOf(nUnits)) {
    const said = `${pattern.join("")}: ${describe(shape, pattern)}`;
    at("states").append(made("figure", {}, ...drawn(shape, pattern, view, said)));
  }
};

const spec = (row) => {
  const changed = structuredClone(data.base);
  for (const column of columns) {
    if (!column.key) continue;
    const path = column.key.split(".");
    const last = path.pop();
    let section = changed;
    for (const part of path) {
      if (!Object.hasOwn(section, part)) section[part] = {};
      section = section[part];
    }
    section[last] = column.said[row];
  }
  const number = columns[0].values[row];
  const about = `# Design ${number}. The same as YAML: dpg pick FOLDER --design ${number} --spec design_${number}.yaml\n`;
  return `${about}${JSON.stringify(changed, null, 2)}\n`;
};

const select = (row) => {
  selected = row;
  at("design").hidden = row < 0;
  at("title").textContent = row < 0 ? "No design is selected" : `Design ${columns[0].values[row]}`;
  at("states-title").textContent = `${at("title").textContent}: all states and numbers`;
  if (row >= 0) {
    at("numbers").tBodies[0]?.remove();
    const body = made("tbody");
    for (const column of columns) {
      const text = `${textOf(column, row)} ${column.unit}`;
      body.append(
        made(
          "tr",
          {},
          made("th", { scope: "row", textContent: column.name }),
          made("td", { textContent: text }),
        ),
      );
    }
    at("numbers").append(body);
    at("spec").textContent = data.base ? spec(row) : "";
    at("spec-button").hidden = !data.base;
    drawStates();
  }
  redraw();
};
