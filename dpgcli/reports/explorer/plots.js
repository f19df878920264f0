// The scatter and the parallel coordinates, on canvases.

const MOST_LINES = 1500; // drawn between axes: more are a surface, and take longer than a frame

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);

const sheet = (canvas) => {
  const ratio = matchMedia("print").matches ? 3 : window.devicePixelRatio;
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.font = "13px system-ui, sans-serif";
  pen.fillStyle = pen.strokeStyle = color("text");
  return { pen, width, height };
};

const frame = { left: 70, right: 16, top: 12, bottom: 44 };
const inside = (canvas) => ({
  width: canvas.clientWidth - frame.left - frame.right,
  height: canvas.clientHeight - frame.top - frame.bottom,
});

const drawScatter = (onFront) => {
  const canvas = at("scatter");
  const { pen, width, height } = sheet(canvas);
  const room = inside(canvas);
  const across = (i) => frame.left + room.width * chosen.x.places[i];
  const down = (i) => frame.top + room.height * (1 - chosen.y.places[i]);
  pen.lineWidth = 1;
  for (const [axis, isX] of [
    [chosen.x, true],
    [chosen.y, false],
  ]) {
    pen.textAlign = isX ? "center" : "right";
    pen.textBaseline = "middle";
    for (const tick of ticks(axis)) {
      const share = axis.place(tick);
      const x = isX ? frame.left + room.width * share : frame.left - 6;
      const y = isX ? height - frame.bottom + 14 : frame.top + room.height * (1 - share);
      pen.fillText(shown(tick), x, y);
    }
  }
  pen.strokeRect(frame.left - 4, frame.top - 4, room.width + 8, room.height + 8);
  pen.textAlign = "center";
  pen.fillText(chosen.x.label, frame.left + room.width / 2, height - 10);
  pen.save();
  pen.rotate(-Math.PI / 2);
  pen.fillText(chosen.y.label, -(frame.top + room.height / 2), 10);
  pen.restore();
  for (const isPassing of [0, 1]) {
    pen.fillStyle = color(isPassing ? "mark" : "faint");
    const size = isPassing ? 4 : 1.5;
    for (let i = 0; i < n; i++) {
      if (passes[i] === isPassing)
        pen.fillRect(across(i) - size / 2, down(i) - size / 2, size, size);
    }
  }
  pen.strokeStyle = color("front");
  pen.lineWidth = 2;
  for (const i of onFront) {
    pen.beginPath();
    for (const [dx, dy] of [
      [0, -6],
      [6, 0],
      [0, 6],
      [-6, 0],
      [0, -6],
    ])
      pen.lineTo(across(i) + dx, down(i) + dy);
    pen.stroke();
  }
  if (selected >= 0) drawCross(pen, across(selected), down(selected));
  drawBox(pen, room);
};

const drawCross = (pen, x, y) => {
  pen.strokeStyle = color("text");
  pen.lineWidth = 2.5;
  pen.beginPath();
  for (const [dx, dy] of [
    [10, 0],
    [0, 10],
  ]) {
    pen.moveTo(x - dx, y - dy);
    pen.lineTo(x + dx, y + dy);
  }
  pen.stroke();
};

const drawBox = (pen, room) => {
  const [fx, fy] = [filters.get(chosen.x), filters.get(chosen.y)];
  if (!fx && !fy) return;
  const [x0, x1] = (fx || [chosen.x.low, chosen.x.high]).map(chosen.x.place);
  const [y0, y1] = (fy || [chosen.y.low, chosen.y.high]).map(chosen.y.place);
  pen.strokeStyle = color("text");
  pen.lineWidth = 1;
  pen.setLineDash([5, 4]);
  const [left, top] = [frame.left + room.width * x0, frame.top + room.height * (1 - y1)];
  pen.strokeRect(left, top, room.width * (x1 - x0), room.height * (y1 - y0));
  pen.setLineDash([]);
};

const bar = { top: 70, bottom: 24, side: 70 };
const axisPlaces = (canvas) => {
  const list = [...axes];
  const step = (canvas.clientWidth - 2 * bar.side) / Math.max(1, list.length - 1);
  return list.map((column, k) => ({ column, x: bar.side + step * k, step }));
};

const drawParallel = () => {
  const canvas = at("parallel");
  const { pen, height } = sheet(canvas);
  const room = height - bar.top - bar.bottom;
  const placed = axisPlaces(canvas);
  const y = (column, i) => bar.top + room * (1 - column.places[i]);
  const line = (i) => {
    pen.beginPath();
    let isDown = false;
    for (const { column, x } of placed) {
      const isKnown = !Number.isNaN(column.places[i]);
      if (isKnown && isDown) pen.lineTo(x, y(column, i));
      else if (isKnown) pen.moveTo(x, y(column, i));
      isDown = isKnown;
    }
    pen.stroke();
  };
  const rows = [];
  for (let i = 0; i < n; i++) if (passes[i]) rows.push(i);
  const every = Math.max(1, Math.ceil(rows.length / MOST_LINES));
  pen.strokeStyle = color("mark");
  pen.globalAlpha = Math.max(0.12, Math.min(0.8, 60 / (rows.length / every)));
  for (let k = 0; k < rows.length; k += every) line(rows[k]);
  pen.globalAlpha = 1;
  if (selected >= 0) {
    pen.strokeStyle = color("text");
    pen.lineWidth = 3;
    line(selected);
  }
  for (const { column, x, step } of placed) drawAxis(pen, column, x, step, room, height);
  const share = every > 1 ? `One line in ${every} is drawn.` : "";
  at("lines").textContent =
    `A line for each design that passes; the thick one is the selected design. ${share}`;
};

const drawAxis = (pen, column, x, step, room, height) => {
  pen.strokeStyle = pen.fillStyle = color("text");
  pen.lineWidth = 1;
  pen.strokeRect(x, bar.top, 0, room);
  pen.textAlign = "center";
  const lines = [];
  for (const word of column.label.split(" ")) {
    const joined = lines.length ? `${lines[lines.length - 1]} ${word}` : word;
    if (lines.length && pen.measureText(joined).width <= Math.max(60, step - 8))
      lines[lines.length - 1] = joined;
    else lines.push(word);
  }
  const first = bar.top - 20 - 14 * (lines.length - 1);
  lines.forEach((text, k) => pen.fillText(text, x, first - 6 + 14 * k));
  pen.fillText(shown(column.high), x, bar.top - 8);
  pen.fillText(shown(column.low), x, height - 8);
  const filter = filters.get(column);
  if (!filter) return;
  const [low, high] = filter.map(column.place);
  pen.lineWidth = 3;
  pen.strokeRect(x - 6, bar.top + room * (1 - high), 12, Math.max(2, room * (high - low)));
};
