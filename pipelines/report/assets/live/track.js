// The track as a map: courses, graticule, scale bar, north; tiles of OpenStreetMap only when the reader asks for them.

const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const GRADES = ["#15803d", "#65a30d", "#ca8a04", "#ea580c", "#dc2626", "#7f1d1d"];
const COLOR_STEPS = 48;

function rampColor(share) {
  const at = Math.max(0, Math.min(1, share)) * (RAMP.length - 1), i = Math.min(RAMP.length - 2, Math.floor(at)), part = at - i;
  return `rgb(${RAMP[i].map((low, k) => Math.round(low + part * (RAMP[i + 1][k] - low))).join(",")})`;
}

function percentile(values, share) {
  const known = values.filter(Number.isFinite).sort();
  return known.length ? known[Math.min(known.length - 1, Math.floor(share * known.length))] : NaN;
}

class TrackMap {
  constructor(page, figure, track) {
    Object.assign(this, { page, figure, track, tiles: false, images: new Map(), shade: "" });
    const latitude = track.lat_deg * Math.PI / 180;
    // metres per degree on the WGS-84 ellipsoid
    const w = 1 - 0.00669437999014 * Math.sin(latitude) ** 2;
    this.north = Math.PI / 180 * 6378137 * (1 - 0.00669437999014) / w ** 1.5;
    this.east = Math.PI / 180 * 6378137 / Math.sqrt(w) * Math.cos(latitude);
    this.main = track.courses.findLast(c => c.kind === "line" && Object.keys(c.values).length) || track.courses.findLast(c => c.kind === "line") || track.courses[0];
    this.canvas = document.createElement("canvas");
    this.canvas.className = "chart";
    figure.area.append(this.bar(), this.canvas);
    this.listen();
    this.fit();
  }

  bar() {
    const bar = document.createElement("div");
    bar.className = "bar";
    const choice = document.createElement("select");
    choice.setAttribute("aria-label", "colour of the track");
    for (const name of ["", ...Object.keys(this.main.values)]) choice.add(new Option(name ? `coloured by ${name}` : "one colour", name));
    choice.onchange = () => { this.shade = choice.value; this.draw(); };
    const button = (text, label, act) => {
      const made = document.createElement("button");
      made.type = "button"; made.textContent = text; made.title = label; made.setAttribute("aria-label", label);
      made.onclick = () => act(made);
      return made;
    };
    bar.append(choice, button("+", "nearer", () => this.zoom(1.6)), button("\u2212", "further", () => this.zoom(1 / 1.6)), button("whole", "the whole track", () => this.fit()),
      button("map tiles", "load the background from openstreetmap.org (uses the network)", made => { this.tiles = !this.tiles; made.classList.toggle("on", this.tiles); this.draw(); }));
    return bar;
  }

  size() {
    const width = this.figure.area.clientWidth, height = Math.max(300, Math.min(width * 0.78, 560)), ratio = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio); this.canvas.height = Math.round(height * ratio);
      this.canvas.style.height = height + "px";
    }
    return { width, height, ratio };
  }

  // The places of all courses, or of the main one from lo to hi.
  fit(lo = -Infinity, hi = Infinity) {
    let west = Infinity, east = -Infinity, south = Infinity, north = -Infinity;
    for (const course of lo > -Infinity ? [this.main] : this.track.courses) {
      for (let i = 0; i < course.t.length; i++) {
        if (course.t[i] < lo || course.t[i] > hi) continue;
        west = Math.min(west, course.east[i]); east = Math.max(east, course.east[i]);
        south = Math.min(south, course.north[i]); north = Math.max(north, course.north[i]);
      }
    }
    if (west > east) return;
    const { width, height } = this.size();
    this.x = (west + east) / 2; this.y = (south + north) / 2;
    this.scale = Math.min(width / Math.max((east - west) * 1.15, 5), height / Math.max((north - south) * 1.15, 5));
    this.draw();
  }

  zoom(factor, at) {
    const { width, height } = this.size(), px = at ? at[0] - width / 2 : 0, py = at ? at[1] - height / 2 : 0;
    this.x += px / this.scale * (1 - 1 / factor); this.y -= py / this.scale * (1 - 1 / factor);
    this.scale *= factor;
    this.draw();
  }

  place(east, north) { return [(east - this.x) * this.scale + this.wide / 2, (this.y - north) * this.scale + this.tall / 2]; }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.paint(); });
  }

  paint() {
    const { width, height, ratio } = this.size(), context = this.canvas.getContext("2d");
    this.wide = width; this.tall = height;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (this.tiles) this.paintTiles(context, width, height);
    this.paintGraticule(context, width, height);
    for (const course of this.track.courses) this.paintCourse(context, course);
    if (this.shade) this.paintKey(context, width, height);
    this.paintScale(context, width, height);
    if (this.page.time !== null) this.paintCursor(context);
    if (this.box) { context.setLineDash([4, 3]); context.strokeStyle = color("text"); context.strokeRect(...this.box); context.setLineDash([]); }
  }

  paintCourse(context, course) {
    const mark = course.kind !== "line", size = course.kind === "dots" ? 2 : 3.5, paint = styleColor(course.style);
    context.lineWidth = mark ? 1.5 : course.style === "reference" ? 3 : 1.8;
    context.lineJoin = "round";
    if (mark) {
      context.beginPath();
      for (let i = 0; i < course.t.length; i++) {
        const [x, y] = this.place(course.east[i], course.north[i]);
        if (x < -9 || y < -9 || x > this.wide + 9 || y > this.tall + 9) continue;
        if (course.kind === "dots") { context.moveTo(x + size, y); context.arc(x, y, size, 0, 7); }
        else { context.moveTo(x - size, y - size); context.lineTo(x + size, y + size); context.moveTo(x + size, y - size); context.lineTo(x - size, y + size); }
      }
      context.globalAlpha = 0.7;
      context.fillStyle = context.strokeStyle = paint;
      if (course.kind === "dots") context.fill(); else context.stroke();
      context.globalAlpha = 1;
      return;
    }
    const values = course.values[this.shade], scale = values && this.range(values), paths = new Map();
    const { lo, hi } = this.page.view, shades = this.figure.shades;
    let shade = 0;
    for (let i = 1; i < course.t.length; i++) {
      const [ax, ay] = this.place(course.east[i - 1], course.north[i - 1]), [bx, by] = this.place(course.east[i], course.north[i]);
      if (Math.max(ax, bx) < 0 || Math.min(ax, bx) > this.wide || Math.max(ay, by) < 0 || Math.min(ay, by) > this.tall) continue;
      const t = course.t[i];
      while (shade < shades.length && shades[shade][1] < t) shade++;
      const lost = !values && course.style !== "reference" && this.track.courses.length && shade < shades.length && t > shades[shade][0];
      const ink = values ? this.ink(values, scale, values.data[i]) : lost ? color("bad") : paint;
      const faint = t < lo || course.t[i - 1] > hi;
      const key = (faint ? "0.25|" : course.style === "reference" ? "0.65|" : "1|") + ink;
      if (!paths.has(key)) paths.set(key, new Path2D());
      paths.get(key).moveTo(ax, ay); paths.get(key).lineTo(bx, by);
    }
    for (const [key, path] of paths) {
      const cut = key.indexOf("|");
      context.globalAlpha = +key.slice(0, cut); context.strokeStyle = key.slice(cut + 1);
      if (values) context.lineWidth = 3;
      context.stroke(path);
    }
    context.globalAlpha = 1;
  }

  range(values) {
    if (values.classes.length) return [1, values.classes.length];
    if (!values.range) values.range = [percentile(values.data, 0.01), percentile(values.data, 0.99)];
    return values.range;
  }

  ink(values, [low, high], value) {
    if (!Number.isFinite(value)) return color("dim");
    if (values.classes.length) return GRADES[Math.max(0, Math.min(GRADES.length - 1, Math.round(value) - 1))];
    return rampColor(Math.round((value - low) / (high - low || 1) * COLOR_STEPS) / COLOR_STEPS);
  }

  paintKey(context, width) {
    const values = this.main.values[this.shade], range = this.range(values);
    context.font = "11px system-ui"; context.textAlign = "left"; context.textBaseline = "top";
    const rows = values.classes.length ? values.classes.map((name, i) => [GRADES[i], name])
      : [0, 0.25, 0.5, 0.75, 1].map(share => [rampColor(share), `${numberText(+(range[0] + share * (range[1] - range[0])).toPrecision(3))} ${values.unit}`]);
    const wide = 22 + Math.max(...rows.map(row => context.measureText(row[1]).width));
    context.fillStyle = color("card"); context.globalAlpha = 0.85; context.fillRect(6, 6, wide + 8, rows.length * 15 + 6); context.globalAlpha = 1;
    rows.forEach(([paint, name], i) => {
      context.fillStyle = paint; context.fillRect(10, 10 + 15 * i, 12, 11);
      context.fillStyle = color("text"); context.fillText(name, 26, 10 + 15 * i);
    });
  }

  paintGraticule(context, width, height) {
    const steps = [30, 20, 10, 5, 2, 1, 1 / 2, 1 / 6, 1 / 12, 1 / 30, 1 / 60, 1 / 120, 1 / 360, 1 / 720, 1 / 1800, 1 / 3600, 1 / 7200, 1 / 36000, 1 / 72000, 1 / 360000];
    const step = steps.find(degrees => degrees * this.east * this.scale < width / 2.2) || steps.at(-1);
    const seconds = step < 1 / 60 - 1e-9;
    const digits = step < 1 / 3600 ? Math.min(2, Math.ceil(-Math.log10(step * 3600) - 1e-9)) : 0;
    const name = (degrees, marks) => {
      const ticks = Math.round(Math.abs(degrees) * 3600 * 10 ** digits), whole = Math.floor(ticks / 10 ** digits);
      const rest = digits ? "." + pad(ticks % 10 ** digits, digits) : "";
      return `${Math.floor(whole / 3600)}°${pad(Math.floor(whole / 60) % 60)}\u2032${seconds ? pad(whole % 60) + rest + "\u2033" : ""}${degrees < 0 ? marks[1] : marks[0]}`;
    };
    context.strokeStyle = color("rule"); context.fillStyle = color("dim"); context.lineWidth = 1; context.font = "10px system-ui";
    context.beginPath();
    const west = this.track.lon_deg + (this.x - width / 2 / this.scale) / this.east, east = this.track.lon_deg + (this.x + width / 2 / this.scale) / this.east;
    const south = this.track.lat_deg + (this.y - height / 2 / this.scale) / this.north, north = this.track.lat_deg + (this.y + height / 2 / this.scale) / this.north;
    context.textBaseline = "bottom"; context.textAlign = "left";
    for (let k = Math.ceil(west / step); k * step <= east && k - west / step < 60; k++) {
      const [x] = this.place((k * step - this.track.lon_deg) * this.east, 0);
      context.moveTo(x, 0); context.lineTo(x, height);
      context.fillText(name(k * step, "EW"), x + 3, height - 2);
    }
    for (let k = Math.ceil(south / step); k * step <= north && k - south / step < 60; k++) {
      const [, y] = this.place(0, (k * step - this.track.lat_deg) * this.north);
      context.moveTo(0, y); context.lineTo(width, y);
      if (y > 20 && y < height - 30) context.fillText(name(k * step, "NS"), 3, y - 2);
    }
    context.stroke();
  }

  paintScale(context, width, height) {
    const room = Math.min(140, width / 3) / this.scale, power = 10 ** Math.floor(Math.log10(room));
    const metres = [5, 2, 1].map(f => f * power).find(m => m <= room), long = metres * this.scale;
    context.strokeStyle = context.fillStyle = color("text"); context.lineWidth = 1.5; context.font = "11px system-ui";
    context.beginPath();
    const x = width - 12 - long, y = height - 24;
    context.moveTo(x, y - 5); context.lineTo(x, y); context.lineTo(x + long, y); context.lineTo(x + long, y - 5);
    context.stroke();
    context.textAlign = "center"; context.textBaseline = "bottom";
    context.fillText(metres >= 1000 ? `${metres / 1000} km` : metres >= 1 ? `${metres} m` : `${+(metres * 100).toPrecision(2)} cm`, x + long / 2, y - 4);
    context.beginPath();
    context.moveTo(width - 20, 12); context.lineTo(width - 26, 32); context.lineTo(width - 20, 27); context.lineTo(width - 14, 32); context.closePath();
    context.fill();
    context.fillText("N", width - 20, 46);
    if (this.tiles) { context.textAlign = "left"; context.fillText("\u00a9 OpenStreetMap contributors", 6, height - 16); }
  }

  paintCursor(context) {
    for (const course of this.track.courses) {
      if (course.kind !== "line" || course.style === "reference") continue;
      const i = nearestIndex(course.t, this.page.time), [x, y] = this.place(course.east[i], course.north[i]);
      context.beginPath(); context.arc(x, y, 6, 0, 7);
      context.lineWidth = 2.5; context.strokeStyle = color("card"); context.stroke();
      context.lineWidth = 1.5; context.fillStyle = styleColor(course.style); context.fill(); context.strokeStyle = color("text"); context.stroke();
    }
  }

  paintTiles(context, width, height) {
    const latitude = this.track.lat_deg * Math.PI / 180;
    const level = Math.max(0, Math.min(19, Math.round(Math.log2(this.scale * 2 * Math.PI * 6378137 * Math.cos(latitude) / 256)))), count = 2 ** level;
    const column = lon => (lon + 180) / 360 * count, row = lat => (1 - Math.asinh(Math.tan(lat * Math.PI / 180)) / Math.PI) / 2 * count;
    const lon = i => i / count * 360 - 180, lat = j => Math.atan(Math.sinh(Math.PI * (1 - 2 * j / count))) * 180 / Math.PI;
    const east = px => this.track.lon_deg + (this.x + (px - width / 2) / this.scale) / this.east, north = py => this.track.lat_deg + (this.y + (height / 2 - py) / this.scale) / this.north;
    const put = (image, i, j) => {
      const [x, y] = this.place((lon(i) - this.track.lon_deg) * this.east, (lat(j) - this.track.lat_deg) * this.north);
      const [right, foot] = this.place((lon(i + 1) - this.track.lon_deg) * this.east, (lat(j + 1) - this.track.lat_deg) * this.north);
      context.drawImage(image, x, y, right - x, foot - y);
    };
    for (let i = Math.floor(column(east(0))); i <= column(east(width)); i++) {
      for (let j = Math.floor(row(north(0))); j <= row(north(height)); j++) {
        const address = `https://tile.openstreetmap.org/${level}/${i}/${j}.png`;
        let image = this.images.get(address);
        if (!image) { image = new Image(); image.onload = () => this.draw(); image.src = address; this.images.set(address, image); }
        if (image.complete && image.naturalWidth) put(image, i, j);
      }
    }
  }

  // The time of the course nearest to a pixel; null where none is near.
  timeAt(x, y) {
    let best = 24 ** 2, time = null;
    for (let i = 0; i < this.main.t.length; i++) {
      const [px, py] = this.place(this.main.east[i], this.main.north[i]), far = (px - x) ** 2 + (py - y) ** 2;
      if (far < best) { best = far; time = this.main.t[i]; }
    }
    return time;
  }

  listen() {
    const fingers = new Map();
    const at = event => { const box = this.canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    let start = null, moved = false;
    this.canvas.addEventListener("pointerdown", event => {
      fingers.set(event.pointerId, at(event)); this.canvas.setPointerCapture(event.pointerId);
      start = at(event); moved = false; this.boxing = event.shiftKey;
    });
    this.canvas.addEventListener("pointermove", event => {
      const here = at(event), before = fingers.get(event.pointerId);
      if (!before) { const time = this.timeAt(...here); if (time !== null) this.page.point(time, this.figure); return; }
      if (Math.hypot(here[0] - start[0], here[1] - start[1]) > 4) moved = true;
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        this.zoom(Math.hypot(here[0] - other[0], here[1] - other[1]) / Math.max(1, Math.hypot(before[0] - other[0], before[1] - other[1])), [(here[0] + other[0]) / 2, (here[1] + other[1]) / 2]);
      } else if (this.boxing) {
        this.box = [Math.min(start[0], here[0]), Math.min(start[1], here[1]), Math.abs(here[0] - start[0]), Math.abs(here[1] - start[1])]; this.draw();
      } else { this.x -= (here[0] - before[0]) / this.scale; this.y += (here[1] - before[1]) / this.scale; this.draw(); }
      fingers.set(event.pointerId, here);
    });
    const end = event => {
      fingers.delete(event.pointerId);
      if (this.box) {
        const [x, y, w, h] = this.box; this.box = null;
        if (w > 6 && h > 6) {
          this.x += (x + w / 2 - this.wide / 2) / this.scale; this.y -= (y + h / 2 - this.tall / 2) / this.scale;
          this.scale *= Math.min(this.wide / w, this.tall / h);
        }
        this.draw();
      } else if (!moved && event.type === "pointerup") { const time = this.timeAt(...at(event)); if (time !== null) this.page.point(time, this.figure); }
    };
    this.canvas.addEventListener("pointerup", end);
    this.canvas.addEventListener("pointercancel", end);
    this.canvas.addEventListener("dblclick", () => this.fit());
    this.canvas.addEventListener("wheel", event => {
      if (!event.ctrlKey && !event.metaKey && !this.figure.node.contains(document.activeElement)) return;
      event.preventDefault(); this.zoom(Math.exp(-event.deltaY / 300), at(event));
    }, { passive: false });
  }
}
