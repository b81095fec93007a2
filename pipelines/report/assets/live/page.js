// One view and one cursor for the whole page: zoom, pan, keys, rows of tables that lead to their time.

class Page {
  constructor(spec, block) {
    this.duration = spec.duration_s;
    this.startMs = spec.start_ms;
    this.view = { lo: 0, hi: spec.duration_s };
    this.time = null;
    this.busy = false;
    this.figures = [];
    this.bar = this.makeBar();
    const seen = new IntersectionObserver(entries => {
      for (const entry of entries) if (entry.isIntersecting) { seen.unobserve(entry.target); this.start(this.figures.find(f => f.node === entry.target)); }
    }, { rootMargin: "600px" });
    spec.plots.forEach((plot, i) => {
      const node = document.querySelector(`figure[data-live="${i}"]`);
      if (!plot || !node) return;
      const figure = { node, plot, shades: plot.shades, charts: [], map: null, panels: [], output: node.querySelector("output"), area: null };
      figure.load = () => this.load(figure, block);
      this.figures.push(figure);
      seen.observe(node);
    });
    this.listen();
  }

  load(figure, block) {
    const layer = one => ({ ...one, x: readArray(block, one.x), y: readArray(block, one.y), high: one.high && readArray(block, one.high) });
    figure.panels = figure.plot.panels.map(panel => ({ ...panel, layers: panel.layers.map(layer) }));
    if (!figure.plot.track) return null;
    const courses = figure.plot.track.courses.map(course => ({
      ...course, t: readArray(block, course.t), east: readArray(block, course.east), north: readArray(block, course.north),
      values: Object.fromEntries(Object.entries(course.values).map(([name, v]) => [name, { ...v, data: readArray(block, v.data) }])),
    }));
    return { ...figure.plot.track, courses };
  }

  start(figure) {
    if (figure.area) return;
    const track = figure.load();
    figure.area = document.createElement("div");
    figure.area.className = "live";
    figure.area.setAttribute("role", "group");
    figure.area.setAttribute("aria-label", `${figure.plot.title}: arrow keys move the cursor, + and - zoom, 0 shows the whole drive`);
    figure.area.tabIndex = 0;
    figure.output.before(figure.area);
    figure.node.classList.add("drawn");
    if (track) figure.map = new TrackMap(this, figure, track);
    else this.makeCharts(figure);
    if (this.time !== null) this.mark(figure);
  }

  makeCharts(figure) {
    const width = figure.area.clientWidth;
    figure.charts = figure.panels.map((panel, i) => makePanel(this, figure, panel, i === figure.panels.length - 1, width));
    figure.charts.forEach((chart, i) => { chart.root.dataset.panel = i; });
  }

  makeBar() {
    const bar = document.createElement("div");
    bar.className = "timebar";
    bar.innerHTML = '<span class="range"></span><span class="now"></span><span class="keys">'
      + '<button type="button" data-do="earlier" aria-label="earlier" title="earlier (Shift \u2190)">\u2190</button><button type="button" data-do="nearer" aria-label="zoom in" title="zoom in (+)">+</button>'
      + '<button type="button" data-do="further" aria-label="zoom out" title="zoom out (-)">\u2212</button><button type="button" data-do="later" aria-label="later" title="later (Shift \u2192)">\u2192</button>'
      + '<button type="button" data-do="whole" title="the whole drive (0 or double click)">whole drive</button></span>'
      + '<span class="help">Drag across a plot to zoom, Shift and drag to move; on the track drag to move, Shift and drag for a box. Keys: \u2190 \u2192 + \u2212 0.</span>';
    document.querySelector(".plots").before(bar);
    bar.addEventListener("click", event => { const act = event.target.dataset.do; if (act) this[act](); });
    return bar;
  }

  show(lo, hi) {
    const least = 0.02, span = Math.min(Math.max(hi - lo, least), this.duration || least);
    const middle = (lo + hi) / 2;
    lo = Math.max(0, Math.min(middle - span / 2, this.duration - span));
    this.view = { lo, hi: lo + span };
    this.busy = true;
    for (const figure of this.figures) {
      for (const chart of figure.charts) chart.redraw(false, true), chart.setScale("x", { min: lo, max: lo + span });
      if (figure.map) figure.map.draw();
    }
    this.busy = false;
    if (this.time !== null) for (const figure of this.figures) this.mark(figure);
    this.tell();
  }

  whole() { this.show(0, this.duration); for (const figure of this.figures) if (figure.map) figure.map.fit(); }
  nearer() { this.scale(0.5); }
  further() { this.scale(2); }
  earlier() { this.pan(-0.25); }
  later() { this.pan(0.25); }
  pan(share) { const span = this.view.hi - this.view.lo; this.show(this.view.lo + share * span, this.view.hi + share * span); }

  scale(factor, about = this.time) {
    const { lo, hi } = this.view, at = about !== null && about >= lo && about <= hi ? about : (lo + hi) / 2;
    this.show(at - (at - lo) * factor, at + (hi - at) * factor);
  }

  point(time, from = null) {
    this.time = Math.max(0, Math.min(this.duration, time));
    for (const figure of this.figures) this.mark(figure, figure === from);
    this.tell();
  }

  mark(figure, read = true) {
    this.busy = true;
    for (const chart of figure.charts) {
      const left = chart.valToPos(this.time, "x"), inside = left >= 0 && left <= chart.over.clientWidth;
      chart.setCursor(inside ? { left, top: 1 } : { left: -10, top: -10 }, false);
    }
    this.busy = false;
    if (figure.map) figure.map.draw();
    if (!figure.area) return;
    const reach = Math.max((this.view.hi - this.view.lo) / 100, 0.6);
    const texts = figure.panels.map(panel => readValues(panel, this.time, reach)).filter(Boolean);
    figure.output.textContent = read ? [this.stamp(this.time), ...texts, ...this.trackTexts(figure)].join("  \u00b7  ") : "";
  }

  trackTexts(figure) {
    if (!figure.map) return [];
    const main = figure.map.main, i = nearestIndex(main.t, this.time);
    return [`east ${numberText(main.east[i])} m, north ${numberText(main.north[i])} m`,
      ...Object.entries(main.values).map(([name, v]) => `${name} ${v.classes.length ? v.classes[v.data[i] - 1] || "\u2013" : `${numberText(v.data[i])} ${v.unit}`}`)];
  }

  stamp(time) {
    const decimals = decimalsFor(this.view.hi - this.view.lo);
    return `${elapsedText(time, decimals)} (${utcText(time, this.startMs, decimals)} UTC)`;
  }

  tell() {
    const { lo, hi } = this.view;
    this.bar.querySelector(".range").textContent = `${elapsedText(lo)} to ${elapsedText(hi)}, ${utcText(lo, this.startMs)} to ${utcText(hi, this.startMs)} UTC`;
    this.bar.querySelector(".now").textContent = this.time === null ? "" : `cursor ${this.stamp(this.time)}`;
  }

  // Shows a stretch with as much again around it, the cursor on its start or on the one time that it is.
  goTo(start, end) {
    const around = Math.max((end - start) / 2, 5);
    this.show(start - around, end + around);
    this.point(end > start ? (start + end) / 2 : start);
    for (const figure of this.figures) if (figure.map) figure.map.fit(start - around, end + around);
    this.bar.scrollIntoView({ behavior: matchMedia("(prefers-reduced-motion: reduce)").matches ? "auto" : "smooth", block: "start" });
  }

  listen() {
    document.addEventListener("keydown", event => {
      if (event.ctrlKey || event.metaKey || event.altKey || /^(SELECT|INPUT|TEXTAREA)$/.test(event.target.tagName)) return;
      const step = (this.view.hi - this.view.lo) / 200, now = this.time === null ? (this.view.lo + this.view.hi) / 2 : this.time;
      const act = {
        ArrowLeft: () => event.shiftKey ? this.earlier() : this.point(now - step), ArrowRight: () => event.shiftKey ? this.later() : this.point(now + step),
        "+": () => this.nearer(), "=": () => this.nearer(), "-": () => this.further(), 0: () => this.whole(), Escape: () => this.whole(),
      }[event.key];
      if (act) { event.preventDefault(); act(); }
    });
    for (const row of document.querySelectorAll("[data-from]")) {
      row.tabIndex = 0;
      row.setAttribute("role", "link");
      row.title = "show this stretch in all plots";
      const go = () => this.goTo(+row.dataset.from, +row.dataset.to);
      row.addEventListener("click", () => { if (!String(getSelection())) go(); });
      row.addEventListener("keydown", event => { if (event.key === "Enter") go(); });
    }
    document.querySelector(".plots").addEventListener("wheel", event => {
      const over = event.target.closest && event.target.closest(".u-over");
      if (!over || !(event.ctrlKey || event.metaKey)) return;
      event.preventDefault();
      const box = over.getBoundingClientRect(), share = (event.clientX - box.left) / box.width;
      this.scale(Math.exp(event.deltaY / 300), this.view.lo + share * (this.view.hi - this.view.lo));
    }, { passive: false });
    this.listenToFingers();
    this.listenToPan();
    let width = innerWidth;
    addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; this.resize(); } });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.resize());
  }

  // Shift and drag: the view moves with the mouse; taken before uPlot sees it as a selection.
  listenToPan() {
    document.querySelector(".plots").addEventListener("mousedown", event => {
      const over = event.target.closest(".u-over");
      if (!over || !event.shiftKey) return;
      event.stopPropagation(); event.preventDefault();
      const start = event.clientX, { lo, hi } = this.view, wide = over.clientWidth;
      const move = e => { const by = (start - e.clientX) / wide * (hi - lo); this.show(lo + by, hi + by); };
      addEventListener("mousemove", move);
      addEventListener("mouseup", () => removeEventListener("mousemove", move), { once: true });
    }, true);
  }

  // One finger moves the cursor, two zoom and pan.
  listenToFingers() {
    let before = null;
    const spread = event => [...event.touches].map(t => t.clientX).sort((a, b) => a - b);
    document.querySelector(".plots").addEventListener("touchmove", event => {
      const over = event.target.closest(".u-over");
      if (!over) return;
      const box = over.getBoundingClientRect(), { lo, hi } = this.view;
      const timeOf = x => lo + (x - box.left) / box.width * (hi - lo);
      if (event.touches.length === 1) {
        this.point(timeOf(event.touches[0].clientX), this.figures.find(f => f.node.contains(over)));
      } else {
        event.preventDefault();
        const now = spread(event);
        if (before) {
          const factor = Math.max(before[1] - before[0], 8) / Math.max(now[1] - now[0], 8), middle = timeOf((before[0] + before[1]) / 2);
          const shift = ((now[0] + now[1]) - (before[0] + before[1])) / 2 / box.width * (hi - lo) * factor;
          this.show(middle - (middle - lo) * factor - shift, middle + (hi - middle) * factor - shift);
        }
        before = now;
      }
    }, { passive: false });
    for (const end of ["touchend", "touchcancel"]) document.addEventListener(end, () => { before = null; });
  }

  resize() {
    for (const figure of this.figures) {
      for (const chart of figure.charts) chart.destroy();
      if (figure.charts.length) this.makeCharts(figure);
      if (figure.map) figure.map.draw();
    }
    if (this.time !== null) this.point(this.time);
  }
}

async function openPage() {
  const described = document.getElementById("plots-described");
  if (!described || typeof DecompressionStream === "undefined") return;
  const page = new Page(JSON.parse(described.textContent), await readBlock("plots-data"));
  page.tell();
  window.navreplayPage = page;
}

openPage();
