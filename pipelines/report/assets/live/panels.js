// Panels over time: uPlot keeps scales, axes, cursor and selection; the layers are drawn here, two points a pixel.

const PANEL_HEIGHT = 118, AXIS_HEIGHT = 26, AXIS_WIDTH = 62;

function extentOf(panel, lo, hi) {
  let low = Infinity, high = -Infinity, least = Infinity;
  const take = value => {
    if (value < low) low = value;
    if (value > high) high = value;
    if (value > 0 && value < least) least = value;
  };
  for (const layer of panel.layers) {
    const from = Math.max(0, lowerBound(layer.x, lo) - 1), to = Math.min(layer.x.length, lowerBound(layer.x, hi) + 1);
    if (layer.kind !== "band") {
      for (let i = from; i < to; i++) take(layer.y[i]);
    } else {
      // what 98 % of an envelope need: its ends may be a thousand times as wide as all else
      const edges = [...layer.y.subarray(from, to), ...layer.high.subarray(from, to)].filter(Number.isFinite).sort((a, b) => a - b);
      if (edges.length) { take(edges[Math.floor(0.01 * edges.length)]); take(edges[Math.ceil(0.99 * edges.length) - 1]); }
    }
  }
  if (low > high) return panel.bend === 0 ? [0.1, 10] : [0, 1];
  if (panel.bend === 0) return [(least < Infinity ? least : 0.1) / 1.3, Math.max(high, least) * 1.3];
  const margin = 0.06 * (high - low) || 0.1 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

// Lowest and highest of each pixel column, with where the line comes in and goes out.
function traceLine(context, xs, ys, from, to, px, py) {
  let open = false, column = NaN, low = 0, high = 0, last = 0;
  const flush = () => { if (low !== high) { context.lineTo(column, low); context.lineTo(column, high); context.lineTo(column, last); } };
  for (let i = from; i < to; i++) {
    if (!Number.isFinite(ys[i])) { if (open) flush(); open = false; column = NaN; continue; }
    const x = Math.round(px(xs[i]) * 2) / 2, y = py(ys[i]);
    if (!open) { context.moveTo(x, y); open = true; column = x; low = high = last = y; continue; }
    if (x === column) { if (y < low) low = y; if (y > high) high = y; last = y; continue; }
    flush();
    context.lineTo(x, y);
    column = x; low = high = last = y;
  }
  if (open) flush();
}

function drawLayer(context, layer, lo, hi, px, py, ratio) {
  const from = Math.max(0, lowerBound(layer.x, lo) - 1), to = Math.min(layer.x.length, lowerBound(layer.x, hi) + 1);
  const paint = styleColor(layer.style);
  context.beginPath();
  if (layer.kind === "band") {
    for (let i = from; i < to; i++) context.lineTo(px(layer.x[i]), py(layer.high[i]));
    for (let i = to - 1; i >= from; i--) context.lineTo(px(layer.x[i]), py(layer.y[i]));
    context.globalAlpha = 0.17;
    context.fillStyle = paint;
    context.fill();
  } else if (layer.kind === "line") {
    traceLine(context, layer.x, layer.y, from, to, px, py);
    context.strokeStyle = paint;
    context.globalAlpha = layer.style === "reference" ? 0.7 : 1;
    context.lineWidth = (layer.style === "reference" ? 2.4 : 1.3) * ratio;
    context.lineJoin = "round";
    context.stroke();
  } else {
    const size = (layer.kind === "dots" ? 1.5 : 3) * ratio;
    for (let i = from; i < to; i++) {
      const x = px(layer.x[i]), y = py(layer.y[i]);
      if (layer.kind === "dots") { context.moveTo(x + size, y); context.arc(x, y, size, 0, 7); }
      else { context.moveTo(x - size, y - size); context.lineTo(x + size, y + size); context.moveTo(x + size, y - size); context.lineTo(x - size, y + size); }
    }
    if (layer.kind === "dots") { context.fillStyle = paint; context.fill(); }
    else { context.strokeStyle = paint; context.lineWidth = 1.4 * ratio; context.stroke(); }
  }
  context.globalAlpha = 1;
}

function drawPanel(u, panel, shades, view) {
  const context = u.ctx, box = u.bbox;
  const px = x => u.valToPos(x, "x", true);
  const py = y => Math.max(box.top - 1e4, Math.min(box.top + box.height + 1e4, u.valToPos(panel.bend === 0 ? Math.max(y, 1e-12) : y, "y", true)));
  context.save();
  context.beginPath();
  context.rect(box.left, box.top, box.width, box.height);
  context.clip();
  context.fillStyle = color("shade");
  for (const [start, end] of shades) {
    const left = px(start);
    context.fillRect(left, box.top, Math.max(px(end) - left, uPlot.pxRatio), box.height);
  }
  for (const layer of panel.layers) drawLayer(context, layer, view.lo, view.hi, px, py, uPlot.pxRatio);
  context.restore();
}

function makePanel(page, figure, panel, isLast, width) {
  const axis = { stroke: () => color("dim"), grid: { stroke: () => color("rule"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
  const distribution = panel.bend === null ? {} : panel.bend === 0 ? { distr: 3 } : { distr: 4, asinh: panel.bend };
  const u = new uPlot({
    width, height: PANEL_HEIGHT + (isLast ? AXIS_HEIGHT : 0), legend: { show: false }, padding: [8, 24, isLast ? 0 : 6, 0],
    scales: { x: { time: false, range: () => [page.view.lo, page.view.hi] }, y: { ...distribution, range: () => extentOf(panel, page.view.lo, page.view.hi) } },
    series: [{}, { show: true, stroke: "transparent" }],
    axes: [
      { ...axis, show: true, size: isLast ? AXIS_HEIGHT : 0, space: 64, incrs: [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400],
        values: (_, ticks) => isLast ? ticks.map(t => elapsedText(t, ticks.length > 1 && ticks[1] - ticks[0] < 1 ? decimalsFor((ticks[1] - ticks[0]) * 10) : 0)) : ticks.map(() => "") },
      { ...axis, size: AXIS_WIDTH, label: panel.label, labelSize: 16, labelFont: "11px system-ui", labelGap: 0, space: 26, values: (_, ticks) => ticks.map(t => t === null ? "" : tickText(t)) },
    ],
    cursor: { y: false, points: { show: false }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => { page.whole(); return null; } } },
    hooks: {
      draw: [u => drawPanel(u, panel, figure.shades, page.view)],
      setCursor: [u => { if (!page.busy && u.cursor.left >= 0) page.point(u.posToVal(u.cursor.left, "x"), figure); }],
      setSelect: [u => { if (u.select.width > 4) { page.show(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")); } u.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false); }],
    },
  }, [[0, page.duration], [null, null]], figure.area);
  u.over.style.touchAction = "pan-y";
  return u;
}

// The layers of a figure at a time, as texts; a value further off than a hundredth of the view is not one at this time.
function readValues(panel, t, reach) {
  const texts = [];
  const unit = (panel.label.match(/\[(.*)\]/) || ["", ""])[1];
  for (const layer of panel.layers) {
    if (!layer.x.length) continue;
    const i = nearestIndex(layer.x, t);
    if (Math.abs(layer.x[i] - t) > reach || !Number.isFinite(layer.y[i])) continue;
    const value = layer.kind === "band" ? `${numberText(layer.y[i])} to ${numberText(layer.high[i])}` : numberText(layer.y[i]);
    texts.push(`${layer.name} ${value}${unit ? " " + unit : ""}`);
  }
  return texts.length ? `${panel.label.replace(/ *\[.*/, "")}: ${texts.join(", ")}` : "";
}
