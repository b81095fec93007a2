// A cursor through all time plots, and the values under it.
"use strict";
(function () {
  const plots = [...document.querySelectorAll("svg.time")].map(svg => ({
    svg,
    left: +svg.dataset.left,
    span: +svg.dataset.span,
    duration: +svg.dataset.duration,
    output: svg.closest("figure").querySelector("output"),
    panels: [...svg.querySelectorAll("svg.panel")].map(panel => ({
      panel,
      cursor: panel.querySelector(".cursor"),
      height: +panel.getAttribute("height"),
      lines: null,
    })),
  }));

  function readLines(panel) {
    return [...panel.querySelectorAll("path[data-name]")].map(path => {
      const numbers = path.getAttribute("d").match(/(?<=[M ]|^)-?[\d.]+ -?[\d.]+/g) || [];
      return { name: path.dataset.name, points: numbers.map(pair => pair.split(" ").map(Number)) };
    });
  }

  function nearest(points, x) {
    let low = 0, high = points.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (points[middle][0] < x) low = middle; else high = middle;
    }
    return Math.abs(points[low][0] - x) < Math.abs(points[high][0] - x) ? points[low] : points[high];
  }

  function valueAt(entry, y) {
    const { low, high, bend } = entry.panel.dataset;
    const share = 1 - y / entry.height;
    if (bend === undefined) return +low + share * (high - low);
    if (+bend === 0) return low * (high / low) ** share;
    const first = Math.asinh(low / bend), last = Math.asinh(high / bend);
    return bend * Math.sinh(first + share * (last - first));
  }

  function clock(seconds) {
    const whole = Math.floor(seconds), pad = n => String(n).padStart(2, "0");
    const text = `${Math.floor(whole / 60) % 60}:${pad(whole % 60)}`;
    return whole < 3600 ? text : `${Math.floor(whole / 3600)}:${text.padStart(5, "0")}`;
  }

  function show(plot, share, readOut) {
    const x = share * plot.span;
    const texts = [];
    for (const entry of plot.panels) {
      entry.cursor.setAttribute("d", `M${x.toFixed(1)} 0V${entry.height}`);
      if (!readOut) continue;
      entry.lines = entry.lines || readLines(entry.panel);
      for (const line of entry.lines) {
        if (!line.points.length) continue;
        const point = nearest(line.points, x);
        if (Math.abs(point[0] - x) < 6) texts.push(`${line.name} ${valueAt(entry, point[1]).toPrecision(3)}`);
      }
    }
    plot.output.textContent = readOut ? `${clock(share * plot.duration)}  ${texts.join("  \u00b7  ")}` : "";
  }

  for (const plot of plots) {
    plot.svg.addEventListener("pointermove", event => {
      const box = plot.svg.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width * plot.svg.viewBox.baseVal.width - plot.left;
      const share = Math.min(1, Math.max(0, x / plot.span));
      for (const other of plots) show(other, share, other === plot);
    });
    plot.svg.addEventListener("pointerleave", () => {
      for (const other of plots) {
        for (const entry of other.panels) entry.cursor.setAttribute("d", "");
        other.output.textContent = "";
      }
    });
  }
})();
