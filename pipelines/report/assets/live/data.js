// The arrays of the page: gzipped, base64, each array as the four planes of its 32-bit words.

async function readBlock(id) {
  const text = document.getElementById(id).textContent;
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function readArray(block, place) {
  const n = place.n, words = new Int32Array(n), out = new Float64Array(n);
  for (let i = 0; i < n; i++) {
    const at = place.at + i;
    words[i] = block[at] | block[at + n] << 8 | block[at + 2 * n] << 16 | block[at + 3 * n] << 24;
  }
  if (place.step !== undefined) {
    for (let i = 0, sum = 0; i < n; i++) { sum += words[i]; out[i] = place.first + sum * place.step; }
  } else {
    const floats = new Float32Array(words.buffer);
    for (let i = 0; i < n; i++) out[i] = floats[i] + place.middle;
  }
  return out;
}

// First index whose value is not below x.
function lowerBound(values, x) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < x) low = middle + 1; else high = middle;
  }
  return low;
}

function nearestIndex(values, x) {
  const i = lowerBound(values, x);
  if (i === 0) return 0;
  if (i === values.length) return i - 1;
  return values[i] - x < x - values[i - 1] ? i : i - 1;
}

function pad(number, digits = 2) { return String(number).padStart(digits, "0"); }

// Seconds as m:ss or h:mm:ss, with decimals where the view is that fine.
function elapsedText(seconds, decimals = 0) {
  const scale = 10 ** decimals, ticks = Math.round(Math.abs(seconds) * scale);
  const whole = Math.floor(ticks / scale), part = decimals ? "." + pad(ticks % scale, decimals) : "";
  const minutes = Math.floor(whole / 60) % 60, hours = Math.floor(whole / 3600);
  const text = (hours ? `${hours}:${pad(minutes)}` : `${minutes}`) + `:${pad(whole % 60)}${part}`;
  return seconds < 0 ? "\u2212" + text : text;
}

function utcText(seconds, startMs, decimals = 0) {
  const time = new Date(startMs + seconds * 1000).toISOString();
  return time.slice(11, decimals ? 20 + Math.min(decimals, 3) : 19);
}

function decimalsFor(span) { return Math.max(0, Math.min(3, Math.ceil(2 - Math.log10(Math.max(span, 1e-6))))); }

function numberText(value) {
  if (!Number.isFinite(value)) return "\u2013";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e6) ? value.toExponential(2)
    : size >= 1000 ? value.toFixed(1) : String(+value.toPrecision(4));
  return text.replace("-", "\u2212");
}

function tickText(value) {
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e5) ? value.toExponential().replace("e+", "e") : String(+value.toPrecision(6));
  return text.replace("-", "\u2212");
}

function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim() || "#888";
}

const STYLE_COLORS = { lost: "bad" };
function styleColor(style) { return color(STYLE_COLORS[style] || style); }
