"use strict";
(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const BLUE = "#0072b2", ORANGE = "#d55e00", GREEN = "#009e73", GREY = "#7f7f7f", BLACK = "#1b1f24";
  const COLOURS = [BLUE, "#e69f00", BLACK, "#56b4e9", ORANGE, "#004b7a"];  // as the figures of a run
  const DASHES = ["solid", "solid", "solid", "longdash", "longdash", "longdash"];
  const SIDES = 14;           // of a section that is drawn
  const CURSOR_EVERY = 80;    // ms between two moves of the marks in the flat plots
  const config = { displaylogo: false, responsive: true, showSendToCloud: false, plotlyServerURL: "", showEditInChartStudio: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  const font = { family: "system-ui, sans-serif", size: 13, color: BLACK };
  const axis = (title, more) => Object.assign(
    { title: { text: title }, zeroline: false, gridcolor: "#e4e7ec", linecolor: "#7a838f", ticks: "outside" }, more);

  // Rows of an array that was packed into 16 bits a number.
  function unpacked(packed) {
    if (!packed) return null;
    const bytes = Uint8Array.from(atob(packed.data), (sign) => sign.charCodeAt(0));
    // The least of all stands for what was no finite number.
    const values = Array.from(new Int16Array(bytes.buffer), (value) => value === -32768 ? NaN : value * packed.scale);
    const nest = (flat, shape) => {
      if (shape.length < 2) return flat;
      const size = flat.length / shape[0] || 0;
      return Array.from({ length: shape[0] }, (_, i) => nest(flat.slice(i * size, (i + 1) * size), shape.slice(1)));
    };
    return nest(values, packed.shape);
  }
  const column = (rows, i) => rows.map((row) => row[i]);
  const most = (values, of = (value) => value) => values.reduce((top, value) => Math.max(top, of(value)), -Infinity);
  const least = (values) => -most(values, (value) => -value);
  const mix = (a, b, share) => a.map((value, i) => value + share * (b[i] - value));
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const factor = data.unit.factor, unit = data.unit.output;
  const scaled = (rows) => rows.map((row) => row.map((value) => factor * value));

  // Vectors in three dimensions.
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const plus = (a, b, s) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unitOf = (a) => { const size = Math.sqrt(dot(a, a)) || 1; return [a[0] / size, a[1] / size, a[2] / size]; };

  const reference = data.reference ? scaled(unpacked(data.reference)) : null;
  const episodes = {};
  function episode(number) {
    const kept = data.episodes[number];
    if (!kept) return null;
    if (!episodes[number]) {
      const input = unpacked(kept.input);
      episodes[number] = {
        dt: kept.dt, truth: scaled(unpacked(kept.truth)), output: scaled(unpacked(kept.output)), input,
        shapes: unpacked(kept.shapes), every: kept.every, end: kept.dt * input.length,
      };
    }
    return episodes[number];
  }

  // The value of rows that are `every` apart at a time, linear between two.
  function between(rows, every, time) {
    const place = clamp(time / every, 0, rows.length - 1), before = Math.floor(place);
    const after = Math.min(before + 1, rows.length - 1), share = place - before;
    return Array.isArray(rows[0][0]) ? rows[before].map((row, i) => mix(row, rows[after][i], share))
      : mix(rows[before], rows[after], share);
  }

  // ---------------------------------------------------------------- the rod

  // Axes y and z of the sections along a centreline, turned as little as may be (Wang et al. 2008, double reflection).
  function frames(line) {
    const tangents = line.map((_, i) => unitOf(minus(line[Math.min(i + 1, line.length - 1)], line[Math.max(i - 1, 0)])));
    tangents[0] = [1, 0, 0];  // the base is clamped
    const axes = [[0, 1, 0]];
    for (let i = 0; i + 1 < line.length; i++) {
      const along = minus(line[i + 1], line[i]), square = dot(along, along) || 1;
      const y = plus(axes[i], along, -2 / square * dot(along, axes[i]));
      const t = plus(tangents[i], along, -2 / square * dot(along, tangents[i]));
      const rest = minus(tangents[i + 1], t), size = dot(rest, rest);
      axes.push(unitOf(size > 1e-18 ? plus(y, rest, -2 / size * dot(rest, y)) : y));
    }
    return axes.map((y, i) => [y, cross(tangents[i], y)]);
  }

  // Plotted are y, z and, upwards, x.
  const shown = (points) => ({
    x: points.map((p) => p && 1e3 * p[1]), y: points.map((p) => p && 1e3 * p[2]), z: points.map((p) => p && 1e3 * p[0]),
  });
  function body(line, axes) {
    const points = [];
    line.forEach((centre, i) => {
      for (let k = 0; k < SIDES; k++) {
        const angle = 2 * Math.PI * k / SIDES, [hy, hz] = data.rod.half[i];
        points.push(plus(plus(centre, axes[i][0], hy * Math.cos(angle)), axes[i][1], hz * Math.sin(angle)));
      }
    });
    return points;
  }
  function triangles(rings) {
    const i = [], j = [], k = [];
    for (let ring = 0; ring + 1 < rings; ring++) for (let side = 0; side < SIDES; side++) {
      const a = ring * SIDES + side, b = ring * SIDES + (side + 1) % SIDES;
      i.push(a, b); j.push(b, b + SIDES); k.push(a + SIDES, a + SIDES);
    }
    return { i, j, k };
  }
  const cable = (route, line, axes) =>
    route.map((at, i) => at && plus(plus(line[i], axes[i][0], at[0]), axes[i][1], at[1]));

  // Blue and thin for the least, grey in the middle, orange and thick for the most.
  function tensionColour(share) {
    const ends = share < 0.5 ? [[0, 84, 150], [107, 114, 128], 2 * share] : [[107, 114, 128], [213, 94, 0], 2 * share - 1];
    return `rgb(${mix(ends[0], ends[1], clamp(ends[2], 0, 1)).map(Math.round).join(",")})`;
  }

  const webgl = (() => {
    try { const canvas = document.createElement("canvas"); return !!(canvas.getContext("webgl2") || canvas.getContext("webgl")); }
    catch (error) { return false; }
  })();
  const VIEWS = {
    side: { eye: { x: 1.75, y: -1.95, z: 0.5 }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.1 } },
    top: { eye: { x: 0, y: -0.01, z: 2.4 }, up: { x: 0, y: 1, z: 0 }, center: { x: 0, y: 0, z: 0 } },
  };
  // A rod that hangs is drawn hanging; with y turned round, too, nothing is mirrored.
  const sense = (range) => data.rod.hangs ? [range[1], range[0]] : range;
  let camera = VIEWS.side, cables = 0, painted = [];

  function drawScene(flight) {
    if (!data.rod || !webgl) return;
    camera = viewed();
    const all = flight.shapes || [Array.from({ length: data.rod.half.length }, (_, i, of = data.rod.half.length) =>
      [data.rod.length * i / (of - 1), 0, 0])];
    const line = all[0], axes = frames(line);
    const points = all.flat(), reach = most(points, (p) => Math.max(Math.abs(p[1]), Math.abs(p[2])) || 0) + most(data.rod.half.flat());
    const side = 1e3 * Math.max(reach, 0.2 * data.rod.length), tall = 1.05e3 * data.rod.length;
    const lowest = Math.min(-25 * data.rod.length, -1e3 * most(points, (p) => -p[0] || 0));
    const traces = [Object.assign({ type: "mesh3d", color: "#9fb4c4", opacity: 0.32, flatshading: false, hoverinfo: "skip",
      lighting: { ambient: 0.75, diffuse: 0.5, specular: 0.1 } }, shown(body(line, axes)), triangles(line.length))];
    cables = data.rod.cables.length;
    data.rod.cables.forEach((route, i) => traces.push(Object.assign({ type: "scatter3d", mode: "lines", name: `cable ${i + 1}`,
      line: { width: 7, color: GREY }, hovertemplate: `cable ${i + 1}<extra></extra>`, connectgaps: false }, shown(cable(route, line, axes)))));
    const still = { type: "scatter3d", mode: "lines", hoverinfo: "skip" };
    traces.push(Object.assign({}, still, { line: { width: 5, color: BLUE } }, shown([line[line.length - 1]])));
    traces.push(Object.assign({}, still, { mode: "markers", marker: { size: 5, color: BLUE } }, shown([line[line.length - 1]])));
    const tips = all.map((points) => points[points.length - 1]);
    const height = 1e3 * tips.reduce((sum, tip) => sum + tip[0], 0) / tips.length;
    // The reference lies in the plane of the tips where the outputs are the tip's own.
    const own = flight.shapes && unit === "mm" && tips.every((tip, i) => {
      const seen = between(flight.truth, flight.dt, i * flight.every);
      return Math.hypot(1e3 * tip[1] - seen[0], 1e3 * tip[2] - seen[1]) < 10 * data.rod.length;
    });
    if (reference && own && reference[0].length === 2) traces.push(Object.assign({}, still, { line: { width: 4, color: BLACK, dash: "dash" },
      x: column(reference, 0), y: column(reference, 1), z: reference.map(() => height) }));
    const box = (title, range, nticks) => ({ title: { text: title }, range, nticks, backgroundcolor: "#fff", gridcolor: "#d5d9df", showbackground: true });
    const ratio = Math.min(0.9 * (tall - lowest) / (2 * side), 1.6);
    Plotly.react("scene", traces, {
      showlegend: false, font, margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "camera",
      scene: { camera: structuredClone(camera), aspectmode: "manual", aspectratio: { x: 0.9, y: 0.9, z: ratio },
        xaxis: box("y / mm", sense([-side, side]), 3), yaxis: box("z / mm", [-side, side], 3), zaxis: box("x / mm", sense([lowest, tall]), 5) },
    }, Object.assign({}, config, { displayModeBar: false, scrollZoom: true }));
    painted = [];
  }

  function moveRod(flight, time) {
    if (!data.rod || !webgl || !flight.shapes) return;
    const line = between(flight.shapes, flight.every, time), axes = frames(line);
    const now = Math.floor(time / flight.every + 1e-9), tips = [];
    for (let i = 0; i <= Math.min(now, flight.shapes.length - 1); i++) tips.push(flight.shapes[i][line.length - 1]);
    const tip = line[line.length - 1];
    const parts = [body(line, axes), ...data.rod.cables.map((route) => cable(route, line, axes)), [...tips, tip], [tip]].map(shown);
    const places = parts.map((_, i) => i);
    Plotly.restyle("scene", { x: parts.map((p) => p.x), y: parts.map((p) => p.y), z: parts.map((p) => p.z) }, places);
    const held = flight.input[clamp(Math.floor(time / flight.dt + 1e-6), 0, flight.input.length - 1)];
    const looks = held.map((value, i) => {
      const [low, high] = inputRange(i), share = (value - low) / (high - low || 1);
      return { colour: tensionColour(Math.round(20 * share) / 20), width: 3 + Math.round(9 * clamp(share, 0, 1)) };
    }).slice(0, cables);
    const key = JSON.stringify(looks);
    if (key !== painted[0]) {
      painted = [key];
      Plotly.restyle("scene", { "line.color": looks.map((look) => look.colour), "line.width": looks.map((look) => look.width) },
        looks.map((_, i) => i + 1));
    }
  }
  function inputRange(i) {
    const limits = data.limits.input;
    return limits ? [limits[0][i], limits[1][i]] : [-1, 1];
  }

  // Plotly's own layout does not always hear of a drag; its scene does.
  function viewed() {
    const drawn = byId("scene")._fullLayout;
    return drawn && drawn.scene._scene ? drawn.scene._scene.getCamera() : camera;
  }
  function look(next) {
    camera = next;
    Plotly.relayout("scene", { "scene.camera": structuredClone(camera) });  // which it changes
  }
  function turned(by, tilt, zoom) {
    camera = viewed();
    const { x, y, z } = camera.eye, far = Math.hypot(x, y, z) * zoom;
    const around = Math.atan2(y, x) + by, high = clamp(Math.asin(z / Math.hypot(x, y, z)) + tilt, -1.5, 1.5);
    return { eye: { x: far * Math.cos(high) * Math.cos(around), y: far * Math.cos(high) * Math.sin(around), z: far * Math.sin(high) },
      up: { x: 0, y: 0, z: 1 }, center: camera.center || { x: 0, y: 0, z: 0 } };
  }
  const TURNS = {
    left: () => turned(-0.2, 0, 1), right: () => turned(0.2, 0, 1), up: () => turned(0, 0.15, 1), down: () => turned(0, -0.15, 1),
    in: () => turned(0, 0, 1 / 1.15), out: () => turned(0, 0, 1.15), side: () => VIEWS.side, top: () => VIEWS.top,
  };
  const KEYS = { ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down", "+": "in", "=": "in", "-": "out" };

  // ---------------------------------------------------------------- flat plots of an episode

  const outputName = (i, count) => count === 2 ? "yz"[i] : `output ${i + 1}`;
  function times(flight, count) { return Array.from({ length: count }, (_, k) => k * flight.dt); }

  function drawPlane(flight) {
    if (flight.truth[0].length !== 2) { byId("plane-figure").hidden = true; return; }
    const traces = [];
    if (reference) traces.push({ x: column(reference, 0), y: column(reference, 1), mode: reference.length > 1 && spread(reference) ? "lines" : "markers",
      line: { color: BLACK, dash: "dash", width: 1.5 }, marker: { symbol: "cross-thin-open", size: 13, color: BLACK }, name: "reference" });
    traces.push({ x: column(flight.truth, 0), y: column(flight.truth, 1), mode: "lines", line: { color: BLUE, width: 2 }, name: "tip" });
    traces.push({ x: [flight.truth[0][0]], y: [flight.truth[0][1]], mode: "markers", marker: { color: BLUE, size: 11 }, name: "now" });
    Plotly.react("plane", traces, { font, margin: { l: 60, r: 12, t: 8, b: 48 }, hovermode: "closest",
      legend: { orientation: "h", y: 1.08, x: 0 },
      xaxis: axis(`y / ${unit}`), yaxis: axis(`z / ${unit}`, { scaleanchor: "x", scaleratio: 1 }) }, config);
  }
  const spread = (rows) => rows[0].some((_, i) => most(column(rows, i)) > least(column(rows, i)));

  function drawOutputs(flight) {
    const count = flight.truth[0].length, traces = [], shapes = [], more = {};
    const at = times(flight, flight.truth.length);
    for (let i = 0; i < count; i++) {
      const row = { xaxis: "x", yaxis: `y${i ? i + 1 : ""}`, showlegend: i === 0 };
      traces.push(Object.assign({ x: at, y: column(flight.output, i), mode: "lines", line: { color: "#b3bac4", width: 6 }, name: "measured" }, row));
      if (reference) traces.push(Object.assign({ x: at, y: column(reference, i).slice(0, at.length), mode: "lines", line: { color: BLACK, dash: "dash", width: 1.5 }, name: "reference" }, row));
      traces.push(Object.assign({ x: at, y: column(flight.truth, i), mode: "lines", line: { color: BLUE, width: 1.5 }, name: "true" }, row));
      more[`yaxis${i ? i + 1 : ""}`] = axis(`${outputName(i, count)} / ${unit}`, { domain: [1 - (i + 1) / count + 0.03, 1 - i / count - 0.02] });
      if (data.limits.output) for (const limits of data.limits.output) if (limits[i] !== null)
        shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, yref: row.yaxis, y0: factor * limits[i], y1: factor * limits[i], line: { color: ORANGE, dash: "dot", width: 1.5 } });
    }
    Plotly.react("outputs", traces, Object.assign({ font, shapes: [cursor(), ...shapes], margin: { l: 60, r: 12, t: 8, b: 44 },
      legend: { orientation: "h", y: 1.12, x: 0 }, xaxis: axis("time / s", { range: [0, flight.end], anchor: `y${count > 1 ? count : ""}` }) }, more), config);
  }
  const cursor = () => ({ type: "line", xref: "x", yref: "paper", x0: 0, x1: 0, y0: 0, y1: 1, line: { color: GREEN, width: 1.5 } });

  function drawInputs(flight) {
    const count = flight.input[0].length, at = times(flight, flight.input.length), traces = [], shapes = [];
    const name = data.unit.input === "N" ? "cable" : "input";
    for (let j = 0; j < count; j++) traces.push({ x: at, y: column(flight.input, j), mode: "lines", name: `${name} ${j + 1}`,
      line: { color: COLOURS[j % 6], dash: DASHES[j % 6], width: 1.7, shape: "hv" } });
    if (data.limits.input) for (const value of new Set(data.limits.input.flat())) if (value !== null)
      shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, y0: value, y1: value, line: { color: GREY, dash: "dot", width: 1.5 } });
    Plotly.react("inputs", traces, { font, shapes: [cursor(), ...shapes], margin: { l: 60, r: 12, t: 8, b: 44 }, legend: { orientation: "h", y: 1.12, x: 0 },
      xaxis: axis("time / s", { range: [0, flight.end] }), yaxis: axis(`${data.unit.input === "N" ? "tension" : "input"} / ${data.unit.input}`) }, config);
  }

  function moveMarks(flight, time) {
    const now = between(flight.truth, flight.dt, time);
    if (now.length === 2) Plotly.restyle("plane", { x: [[now[0]]], y: [[now[1]]] }, [byId("plane").data.length - 1]);
    for (const plot of ["outputs", "inputs"]) Plotly.relayout(plot, { "shapes[0].x0": time, "shapes[0].x1": time });
  }

  // ---------------------------------------------------------------- the search

  function drawConvergence() {
    const trials = data.trials, costs = trials.filter((t) => t.J !== null).map((t) => t.J);
    if (!costs.length) { byId("convergence").parentNode.hidden = true; return; }
    const lowest = least(costs), ceiling = lowest > 0 ? 30 * lowest : most(costs), seen = (t) => Math.min(t.J === null ? (t.atLeast === null ? ceiling : t.atLeast) : t.J, ceiling);
    const place = new Map(trials.map((t, i) => [t.n, i + 1]));
    const kinds = [
      ["seed point", (t) => t.kept && t.phase === "seed", "square-open", BLUE], ["search", (t) => t.kept && t.phase !== "seed", "circle", BLUE],
      ["broke a limit", (t) => t.J !== null && !t.kept, "diamond-open", ORANGE], ["cut: J is above", (t) => t.outcome === "cut", "triangle-up-open", GREY],
      ["failed", (t) => t.outcome === "failed", "x-thin-open", ORANGE],
    ];
    const traces = [];
    for (const [name, is, symbol, color] of kinds) {
      const of = trials.filter(is);
      if (of.length) traces.push({ x: of.map((t) => place.get(t.n)), y: of.map(seen), customdata: of.map((t) => t.n), mode: "markers", name,
        marker: { symbol, color, size: 7, line: { color, width: 1.5 } },
        text: of.map((t) => t.J === null ? (t.failure || "") : `J = ${t.J.toPrecision(4)}`), hovertemplate: "trial %{customdata}<br>%{text}<extra></extra>" });
    }
    const running = (values) => { let best = null; return values.map((J) => { if (J !== null && (best === null || J < best)) best = J; return best; }); };
    const best = running(trials.map((t) => t.kept ? t.J : null));
    traces.push({ x: best.map((_, i) => i + 1), y: best.map((J) => J === null ? null : Math.min(J, ceiling)), mode: "lines", line: { shape: "hv", color: BLACK, width: 2 }, name: "best so far", hoverinfo: "skip" });
    if (data.baseline.length) {
      const sobol = running(data.baseline);
      traces.push({ x: sobol.map((_, i) => i + 1), y: sobol.map((J) => J === null ? null : Math.min(J, ceiling)), mode: "lines", line: { shape: "hv", color: ORANGE, width: 2, dash: "dash" }, name: "best of Sobol points", hoverinfo: "skip" });
    }
    traces.push({ x: [], y: [], mode: "markers", marker: { symbol: "circle-open", size: 15, color: BLACK, line: { width: 2 } }, name: "shown above", hoverinfo: "skip" });
    Plotly.newPlot("convergence", traces, { font, margin: { l: 60, r: 12, t: 8, b: 44 }, hovermode: "closest", legend: { orientation: "h", y: 1.15, x: 0 },
      xaxis: axis("trial, in the order of telling"), yaxis: axis("cost J", lowest > 0 ? { type: "log", tickvals: ticks(lowest, ceiling), ticktext: ticks(lowest, ceiling).map(String) } : {}) }, config);
    byId("convergence").on("plotly_click", (event) => { const n = event.points[0].customdata; if (n !== undefined && data.episodes[n]) show(n); });
    markShown = (n) => {
      const t = trials.find((trial) => trial.n === n);
      if (t) Plotly.restyle("convergence", { x: [[place.get(n)]], y: [[seen(t)]] }, [traces.length - 1]);
    };
  }
  let markShown = () => {};
  function ticks(low, high) {
    const made = [];
    for (let decade = Math.floor(Math.log10(low)); decade <= Math.ceil(Math.log10(high)); decade++)
      for (const digit of high / low < 12 ? [1, 2, 3, 4, 5, 7] : [1, 2, 5]) { const value = +(digit * 10 ** decade).toPrecision(1); if (value >= low / 1.3 && value <= high * 1.3) made.push(value); }
    return made;
  }

  function drawSlices() {
    if (!data.slices.length) return;
    const columns = clamp(Math.floor(byId("slices").clientWidth / 205), 1, Math.min(5, data.slices.length)), rows = Math.ceil(data.slices.length / columns);
    byId("slices").style.height = `${70 + 225 * rows}px`;
    const layout = { font: Object.assign({}, font, { size: 12 }), showlegend: false, grid: { rows, columns, pattern: "independent", ygap: 0.38, xgap: 0.16 },
      margin: { l: 56, r: 10, t: 8, b: 62 }, shapes: [] };
    const low = least(data.slices.flatMap((s) => s.middle)), high = most(data.slices.flatMap((s) => s.middle));
    const positive = least(data.slices.flatMap((s) => s.low)) > 0;
    const traces = [];
    data.slices.forEach((slice, i) => {
      const n = i ? i + 1 : "", place = { xaxis: `x${n}`, yaxis: `y${n}`, hoverinfo: "skip" };
      traces.push(Object.assign({ x: slice.values, y: slice.low, mode: "lines", line: { width: 0 } }, place));
      traces.push(Object.assign({ x: slice.values, y: slice.high, mode: "lines", line: { width: 0 }, fill: "tonexty", fillcolor: "rgba(0,114,178,0.2)" }, place));
      traces.push(Object.assign({ x: slice.values, y: slice.middle, mode: "lines", line: { color: BLUE, width: 2 } }, place,
        { hoverinfo: "all", hovertemplate: `${slice.name} %{x:.4g} ${slice.unit === "1" ? "" : slice.unit}<br>J %{y:.4g}<extra></extra>` }));
      const told = slice.name + (slice.unit === "1" ? "" : ` / ${slice.unit}`);
      layout[`xaxis${n}`] = axis(told, Object.assign({ nticks: 4, title: { text: told, standoff: 4 } }, slice.log ? { type: "log", tickvals: ticks(slice.values[0], slice.values[slice.values.length - 1]), ticktext: ticks(slice.values[0], slice.values[slice.values.length - 1]).map(String), range: [Math.log10(slice.values[0]), Math.log10(slice.values[slice.values.length - 1])] } : {}));
      const top = positive ? Math.max(Math.min(high, 30 * low), 1.5 * low) : high;
      layout[`yaxis${n}`] = axis(i % columns ? "" : "J", positive
        ? { type: "log", range: [Math.log10(low / 1.4), Math.log10(top)], tickvals: ticks(low / 1.4, top), ticktext: ticks(low / 1.4, top).map(String) }
        : { range: [low - 0.1 * (high - low), high] });
      layout.shapes.push({ type: "line", xref: `x${n}`, yref: `y${n} domain`, x0: slice.value, x1: slice.value, y0: 0, y1: 1, line: { color: ORANGE, width: 2, dash: "dash" } });
    });
    Plotly.newPlot("slices", traces, layout, Object.assign({}, config, { displayModeBar: false }));
  }

  // ---------------------------------------------------------------- what moves

  const state = { trial: null, time: 0, playing: false, last: 0, marked: 0 };
  const control = { play: byId("play"), time: byId("time"), clock: byId("clock"), speed: byId("speed"), trial: byId("trial"), onward: byId("onward") };

  function at(time) {
    const flight = episode(state.trial);
    state.time = clamp(time, 0, flight.end);
    control.time.value = state.time;
    control.clock.textContent = `${state.time.toFixed(1)} s`;
    control.time.setAttribute("aria-valuetext", control.clock.textContent);
    moveRod(flight, state.time);
    const now = performance.now();
    if (!state.playing || now - state.marked > CURSOR_EVERY) { state.marked = now; moveMarks(flight, state.time); }
  }

  function show(number) {
    const flight = episode(number);
    if (!flight) return;
    state.trial = number;
    control.trial.value = number;
    control.time.max = flight.end;
    control.time.step = flight.dt;
    drawScene(flight); drawPlane(flight); drawOutputs(flight); drawInputs(flight); markShown(number);
    at(0);
  }

  function play(on) {
    state.playing = on;
    control.play.textContent = on ? "Pause" : "Play";
    if (!on) { at(state.time); return; }
    if (state.time >= episode(state.trial).end) at(0);
    state.last = performance.now();
    requestAnimationFrame(tick);
  }
  function tick(now) {
    if (!state.playing) return;
    const passed = Math.min((now - state.last) / 1e3, 0.2) * Number(control.speed.value), end = episode(state.trial).end;
    state.last = now;
    at(state.time + passed);
    if (state.time >= end) {
      const following = neighbour(1);
      if (control.onward.checked && following !== null) show(following); else { play(false); return; }
    }
    // A slow machine gets time for what its user does between two frames.
    setTimeout(() => requestAnimationFrame(tick), Math.min(performance.now() - now, 100) / 2);
  }
  const order = data.trials.map((t) => t.n).filter((n) => data.episodes[n]);
  function neighbour(step) {
    const place = order.indexOf(state.trial) + step;
    return place >= 0 && place < order.length ? order[place] : null;
  }

  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
  function begin() {
    drawConvergence();
    drawSlices();
    if (!order.length) {
      byId("robot").hidden = true;
      document.documentElement.dataset.ready = "true";
      return;
    }
    for (const t of data.trials) {
      const option = document.createElement("option"), told = t.J !== null ? `J = ${t.J.toPrecision(4)}` : t.outcome === "cut" ? `cut at J = ${t.atLeast.toPrecision(4)}` : "failed";
      option.value = t.n;
      option.textContent = `${t.n}: ${told}${t.n === data.best ? ", best" : ""}${t.n === data.shown ? ", exported" : ""}${data.episodes[t.n] ? "" : ", no record here"}`;
      option.disabled = !data.episodes[t.n];
      control.trial.appendChild(option);
    }
    if (data.rod && !webgl) {
      byId("scene").innerHTML = '<p class="note">This browser shows no three-dimensional graphics (WebGL); the other plots are complete.</p>';
      byId("scene").style.height = "auto";
    }
    if (data.rod && data.limits.input) {
      byId("least").textContent = `${Math.min(...data.limits.input[0])} ${data.unit.input}`;
      byId("most").textContent = `${Math.max(...data.limits.input[1])} ${data.unit.input}`;
    }
    byId("controls").hidden = false;
    control.play.addEventListener("click", () => play(!state.playing));
    control.time.addEventListener("input", () => { if (state.playing) play(false); at(Number(control.time.value)); });
    control.trial.addEventListener("change", () => show(Number(control.trial.value)));
    byId("previous").addEventListener("click", () => { const n = neighbour(-1); if (n !== null) show(n); });
    byId("next").addEventListener("click", () => { const n = neighbour(1); if (n !== null) show(n); });
    byId("best").addEventListener("click", () => show(order.includes(data.best) ? data.best : order[0]));
    for (const button of document.querySelectorAll("[data-turn]")) button.addEventListener("click", () => look(TURNS[button.dataset.turn]()));
    byId("scene").addEventListener("keydown", (event) => {
      const turn = KEYS[event.key];
      if (turn) { event.preventDefault(); look(TURNS[turn]()); } else if (event.key === " ") { event.preventDefault(); play(!state.playing); }
    });
    show(order.includes(data.shown) ? data.shown : order[0]);
    document.documentElement.dataset.ready = "true";
  }
  begin();
})();
