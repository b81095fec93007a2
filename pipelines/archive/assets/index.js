"use strict";
const rows = JSON.parse(document.getElementById("data").textContent);
const keys = [...document.querySelectorAll("th[data-key]")].map((cell) => cell.dataset.key);
const body = document.querySelector("tbody");
const texts = new Set(["drive", "method", "status", "verdict", "start_utc", "note"]);
let shown = rows, drawn = 0, order = { key: "drive", down: false };

function number(value) {
  if (value === null || value === undefined) return "";
  if (typeof value !== "number") return String(value);
  return Number.isInteger(value) ? String(value) : String(Math.abs(value) >= 100 ? Math.round(value) : Number(value.toPrecision(3)));
}

function line(row) {
  const tr = document.createElement("tr");
  tr.className = row.status === "failed" ? "failed" : row.verdict || "";
  const picture = tr.insertCell();
  if (row.track) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", "0 0 64 64");
    const track = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
    track.setAttribute("points", row.track);
    svg.append(track);
    picture.append(svg);
  }
  for (const key of keys) {
    const cell = tr.insertCell();
    if (texts.has(key)) cell.className = "text";
    if (key === "drive" && row.link) {
      const link = document.createElement("a");
      link.href = row.link;
      link.textContent = row.drive;
      cell.append(link);
    } else cell.textContent = number(row[key]);
    if (key === "note") cell.title = row.note || "";
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
  const words = document.getElementById("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  shown = rows.filter((row) => {
    const text = keys.map((key) => row[key]).join(" ").toLowerCase();
    return words.every((word) => text.includes(word));
  });
  const { key, down } = order;
  shown.sort((a, b) => {
    const x = a[key], y = b[key];
    if (x === null || x === undefined || x === "") return 1;
    if (y === null || y === undefined || y === "") return -1;
    return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1);
  });
  document.getElementById("count").textContent = `${shown.length} of ${rows.length}`;
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
