// Shapes of states: poses of stations, one unit after the other.

const SVG = "http://www.w3.org/2000/svg";
const MOST_STATES = 64; // shapes that one can tell apart

const ofUnit = (values, unit) => (Array.isArray(values) ? values[unit] : values);

const poses = (shape, pattern) => {
  const found = [{ x: 0, y: 0, angle: 0 }];
  pattern.forEach((isInverted, unit) => {
    const { x, y, angle } = found[unit];
    const along = isInverted ? ofUnit(shape.along, unit) : ofUnit(shape.length, unit);
    const up = isInverted ? ofUnit(shape.up, unit) : 0;
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const turn = isInverted ? ofUnit(shape.turn, unit) : 0;
    found.push({ x: x + c * along - s * up, y: y + s * along + c * up, angle: angle + turn });
  });
  return found;
};

const moved = ({ x, y, angle }, along, up) => [
  x + Math.cos(angle) * along - Math.sin(angle) * up,
  y + Math.sin(angle) * along + Math.cos(angle) * up,
];

// Outline of a chamber as in reports/outlines.py, which says why: its corners, and the dome in its wall.
const chamber = (shape, stations, k, isInverted) => {
  const [before, after] = reach(shape, stations.length - 1, k);
  const place = (along, up) => moved(stations[k], along, up);
  const [floor, roof] = [shape.layer / 2, ofUnit(shape.height, Math.min(k, stations.length - 2))];
  const points = [place(-before, roof), place(-before, floor), place(after, floor)];
  if (k < stations.length - 1) {
    const radius = shape.dome_width * (shape.axis - shape.layer / 2);
    const center = place(after, shape.axis);
    const depth = Math.min(ofUnit(shape.dome, k), shape.deepest * (before + after));
    const next = reach(shape, stations.length - 1, k + 1)[0];
    const pole = isInverted
      ? moved(stations[k + 1], -next, shape.axis)
      : place(after - depth, shape.axis);
    const up = moved({ x: 0, y: 0, angle: stations[k].angle }, 0, radius);
    for (let step = 0; step < 19; step++) {
      const turn = (step / 18 - 0.5) * Math.PI;
      const [c, s] = [Math.cos(turn), Math.sin(turn)];
      points.push([0, 1].map((d) => center[d] + s * up[d] + c * (pole[d] - center[d])));
    }
  }
  return [...points, place(after, roof)];
};

const reach = (shape, nUnits, k) => {
  const half = (unit) => {
    const [length, gap] = [ofUnit(shape.length, unit), ofUnit(shape.gap, unit)];
    return 0.5 * Math.max(length - gap, shape.least_length * length);
  };
  return [half(Math.max(0, k - 1)), half(Math.min(k, nUnits - 1))];
};

const outlines = (shape, pattern) => {
  const stations = poses(shape, pattern);
  const chambers = stations.map((_, k) => chamber(shape, stations, k, pattern[k]));
  const layer = stations.flatMap((station, k) => {
    const [before, after] = reach(shape, pattern.length, k);
    return [moved(station, -before, 0), moved(station, after, 0)];
  });
  return { stations, chambers, layer };
};

const patternsOf = (nUnits) =>
  Array.from({ length: 2 ** nUnits }, (_, code) =>
    [...code.toString(2).padStart(nUnits, "0")].map(Number),
  );

const windowOf = (shape, nUnits) => {
  const listed =
    2 ** nUnits <= MOST_STATES
      ? patternsOf(nUnits)
      : [Array(nUnits).fill(0), Array(nUnits).fill(1)];
  const stable = listed.filter(
    (pattern) => shape.others[parseInt(pattern.join(""), 2)] === undefined,
  );
  const points = stable.flatMap((pattern) => outlines(shape, pattern).chambers.flat());
  const ends = [0, 1].map((d) =>
    points.reduce(([a, b], p) => [Math.min(a, p[d]), Math.max(b, p[d])], [Infinity, -Infinity]),
  );
  const margin = 0.03 * (ends[0][1] - ends[0][0]);
  return [
    ends[0][0] - margin,
    -ends[1][1] - margin,
    ends[0][1] - ends[0][0] + 2 * margin,
    ends[1][1] - ends[1][0] + 2 * margin,
  ];
};

const drawing = (shape, pattern, view, said) => {
  const svg = document.createElementNS(SVG, "svg");
  const add = (tag, attributes) => {
    const element = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    svg.append(element);
  };
  for (const [key, value] of [
    ["viewBox", view.join(" ")],
    ["role", "img"],
    ["aria-label", said],
  ])
    svg.setAttribute(key, value);
  const listed = (points) => points.map(([x, y]) => `${x.toFixed(3)},${(-y).toFixed(3)}`).join(" ");
  const { chambers, layer } = outlines(shape, pattern);
  chambers.forEach((points, k) => {
    const kind = k === pattern.length ? "end" : pattern[k] ? "inverted" : "ground";
    add("polygon", { points: listed(points), class: `chamber ${kind}` });
  });
  const roof = ofUnit(shape.height, 0);
  const back = -reach(shape, pattern.length, 0)[0];
  add("polyline", {
    points: listed([
      [back, -0.15 * roof],
      [back, 1.15 * roof],
    ]),
    class: "mount",
  });
  add("polyline", { points: listed(layer), class: "layer", "stroke-width": shape.layer });
  return svg;
};

const describe = (shape, pattern) => {
  const code = parseInt(pattern.join(""), 2);
  const status = shape.others[code];
  if (status !== undefined) return status;
  const tip = poses(shape, pattern).at(-1);
  let energy = shape.rest_energy;
  pattern.forEach((isInverted, unit) => (energy += isInverted * ofUnit(shape.energy, unit)));
  return `tip ${shown(tip.x, 4)}, ${shown(tip.y, 4)} mm; ${shown(energy, 4)} mJ`;
};

const drawn = (shape, pattern, view, said) => {
  const isStable = shape.others[parseInt(pattern.join(""), 2)] === undefined;
  const caption = made("figcaption", { textContent: said });
  return isStable ? [drawing(shape, pattern, view, said), caption] : [caption];
};
