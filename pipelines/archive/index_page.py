"""index.html of an archive: every drive and method in a table that sorts and filters without a server, with small tracks."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from math import cos, radians
from pathlib import Path
from typing import Any

import numpy as np

from navreplay.timeline import Floats
from pipelines.archive.catalogue import points_of
from pipelines.archive.manifest import Entry
from pipelines.files.whole_file import write_whole

__all__ = ["write_index"]

NAME = "index.html"
_SHOWN = (
    ("drive", "drive"),
    ("method", "method"),
    ("status", "status"),
    ("verdict", "verdict"),
    ("note", "reason or first finding"),
    ("start_utc", "start UTC"),
    ("duration_s", "duration s"),
    ("distance_m", "distance m"),
    ("horizontal_rms_m", "horizontal rms m"),
    ("horizontal_p95_m", "95 % m"),
    ("position_nees", "NEES"),
    ("position_nis", "NIS"),
    ("std_horizontal_m", "sigma m"),
    ("used_share", "used"),
    ("outages", "outages"),
    ("findings", "findings"),
)
_WORDS = ("method", "status", "verdict", "note")
_LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
_PICTURE_POINTS = 24
_WIDE, _HIGH = 720, 320
_MOST_TITLES = 2000
"""Drives that the map names and draws as tracks; of more it shows where they begin."""


def write_index(folder: Path, entries: Iterable[Entry]) -> None:
    """The page; rows are data, apart from the document, and its script makes a row of the table as it comes into view, so that
    a hundred thousand of them open at once."""
    ordered = sorted(entries, key=lambda one: one.key)
    assets = files("pipelines.archive") / "assets"
    head = "".join(f'<th data-key="{key}">{escape(title)}</th>' for key, title in _SHOWN)
    # a script ends at the first end tag, wherever it stands
    data = json.dumps(_columns(ordered), separators=(",", ":"))
    data = data.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>Archive of {len(ordered)} runs</title><style>{(assets / 'index.css').read_text('utf-8')}</style></head><body>"
        f'<header><h1>Archive of {len(ordered)} runs</h1><input id="filter" type="search" placeholder="filter by any word">'
        f'<span id="count"></span></header><div id="map">{_map(ordered)}</div>'
        f'<div id="rows"><table><thead><tr><th>track</th>{head}</tr></thead><tbody></tbody></table></div>'
        f'<script type="application/json" id="data">{data}</script>'
        f"<script>{(assets / 'index.js').read_text('utf-8')}</script></body></html>\n"
    )
    write_whole(folder / NAME, lambda path: path.write_text(page, encoding="utf-8"))


def _columns(entries: Sequence[Entry]) -> dict[str, Any]:
    """What the table shows, by column; texts that repeat as numbers into a list of words, so that the page stays small."""
    own: dict[str, list[Any]] = {
        "drive": [entry.drive for entry in entries],
        "method": [entry.method for entry in entries],
        "status": [entry.status for entry in entries],
        "note": [entry.reason or entry.row.get("first_finding") or "" for entry in entries],
    }
    columns = {key: own.get(key) or [_short(entry.row.get(key)) for entry in entries] for key, _ in _SHOWN}
    packed: dict[str, Any] = {key: {"values": values} for key, values in columns.items()}
    for key in _WORDS:
        words = {word: number for number, word in enumerate(dict.fromkeys(columns[key]))}
        packed[key] = {"words": list(words), "codes": [words[word] for word in columns[key]]}
    return {"count": len(entries), "columns": packed, "tracks": [_picture(entry.row.get("track") or "") for entry in entries]}


def _short(value: Any) -> Any:
    """Four digits, which is what the table shows."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _picture(track: str) -> str:
    """A track thinned, in a square of 64 by 64: two letters a point, east and from the top."""
    texts = track.split()
    if len(texts) < 2:
        return ""
    # plain numbers: of so few points arrays would cost more than they save
    pairs = [text.split(",") for text in texts[:: max(1, len(texts) // _PICTURE_POINTS)]]
    shrink = cos(radians(float(pairs[0][0])))
    east, south = [float(lon) * shrink for _, lon in pairs], [-float(lat) for lat, _ in pairs]
    left, top = min(east), min(south)
    scale = 55 / (max(max(east) - left, max(south) - top) or 1.0)
    return "".join(
        [_LETTERS[int(4 + (e - left) * scale)] + _LETTERS[int(4 + (n - top) * scale)] for e, n in zip(east, south, strict=True)]
    )


def _map(entries: Sequence[Entry]) -> str:
    """All tracks in one picture, north up; a drive that is small in it is a dot, and of very many all are."""
    tracks = {entry.drive: entry.row["track"] for entry in entries if entry.row.get("track")}
    if not tracks:
        return ""
    if len(tracks) > _MOST_TITLES:
        drawn = _dots(points_of(" ".join([track.partition(" ")[0] for track in tracks.values()])))
    else:
        drawn = _lines({name: points_of(track) for name, track in tracks.items()})
    label = f"tracks of {len(tracks)} drives, north up"
    return f'<svg viewBox="0 0 {_WIDE + 12} {_HIGH + 12}" role="img" aria-label="{label}">{drawn}</svg>'


def _place(points: Floats) -> Callable[[Floats], Floats]:
    """From degrees (k, 2) to the picture that holds all points."""
    (south, west), (north, east) = points.min(axis=0), points.max(axis=0)
    shrink = cos(radians((south + north) / 2))
    span = max((east - west) * shrink / _WIDE, (north - south) / _HIGH) or 1e-9
    return lambda some: np.stack([(some[:, 1] - west) * shrink / span + 6, (north - some[:, 0]) / span + 6], axis=1)


def _dots(begins: Floats) -> str:
    places = np.unique(np.round(_place(begins)(begins)).astype(np.intp), axis=0)
    return "".join([f'<circle cx="{x}" cy="{y}" r="2.5"></circle>' for x, y in places.tolist()])


def _lines(tracks: Mapping[str, Floats]) -> str:
    place = _place(np.concatenate(list(tracks.values())))
    drawn = []
    for name, track in tracks.items():
        at, title = place(track), f"<title>{escape(name)}</title>"
        if np.abs(at - at[0]).sum(axis=1).max() < 2:
            drawn.append(f'<circle cx="{at[0, 0]:.0f}" cy="{at[0, 1]:.0f}" r="2.5">{title}</circle>')
        else:
            corners = " ".join([f"{x:.1f},{y:.1f}" for x, y in at.tolist()])
            drawn.append(f'<polyline points="{corners}">{title}</polyline>')
    return "".join(drawn)
