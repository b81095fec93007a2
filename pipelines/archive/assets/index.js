"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const keys = [...document.querySelectorAll("th[data-key]")].map((cell) => cell.dataset.key);
const body = document.querySelector("tbody");
const texts = new Set(["drive", "method", "status", "verdict", "start_utc", "note"]);
const letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
const all = Array.from({ length: data.count }, (_, row) => row);
let shown = all, drawn = 0, order = { key: "drive", down: false }, words = null;

function value(key, row) {
  const column = data.columns[key];
  return column.words ? column.words[column.codes[row]] : column.values[row];
}

function searchable(row) {
  words ||= new Array(data.count);
  return (words[row] ||= keys.map((key) => value(key, row)).join(" ").toLowerCase());
}

function number(value) {
  if (value === null || value === undefined) return "";
  if (typeof value !== "number") return String(value);
  return Number.isInteger(value) ? String(value) : String(Math.abs(value) >= 100 ? Math.round(value) : Number(value.toPrecision(3)));
}

function picture(track) {
  const points = [];
  for (let i = 0; i < track.length; i += 2) points.push(`${letters.indexOf(track[i])},${letters.indexOf(track[i + 1])}`);
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 64 64");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
  line.setAttribute("points", points.join(" "));
  svg.append(line);
  return svg;
}

function line(row) {
  const tr = document.createElement("tr");
  const status = value("status", row), drive = value("drive", row);
  tr.className = status === "failed" ? "failed" : value("verdict", row) || "";
  const cell = tr.insertCell();
  if (data.tracks[row]) cell.append(picture(data.tracks[row]));
  for (const key of keys) {
    const cell = tr.insertCell();
    if (texts.has(key)) cell.className = "text";
    if (key === "drive" && status === "done") {
      const link = document.createElement("a");
      link.href = ["drives", ...drive.split("/"), value("method", row), "report.html"].map(encodeURIComponent).join("/");
      link.textContent = drive;
      cell.append(link);
    } else cell.textContent = number(value(key, row));
    if (key === "note") cell.title = value("note", row) || "";
  }
  return tr;
}

function more(count) {
  const part = document.createDocumentFragment();
  for (const row of shown.slice(drawn, drawn + count)) part.append(line(row));
  drawn += count;
  body.append(part);
}

function draw() {
  const wanted = document.getElementById("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  shown = wanted.length ? all.filter((row) => wanted.every((word) => searchable(row).includes(word))) : all.slice();
  const { key, down } = order;
  shown.sort((a, b) => {
    const x = value(key, a), y = value(key, b);
    if (x === null || x === undefined || x === "") return 1;
    if (y === null || y === undefined || y === "") return -1;
    return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1);
  });
  document.getElementById("count").textContent = `${shown.length} of ${data.count}`;
  body.replaceChildren();
  drawn = 0;
  more(200);
}

for (const cell of document.querySelectorAll("th[data-key]"))
  cell.addEventListener("click", () => {
    order = { key: cell.dataset.key, down: order.key === cell.dataset.key && !order.down };
    draw();
  });
document.getElementById("filter").addEventListener("input", draw);
addEventListener("scroll", () => {
  if (drawn < shown.length && innerHeight + scrollY > document.body.offsetHeight - 600) more(200);
});
draw();
