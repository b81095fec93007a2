"""index.html of an archive: every drive and method in a table that sorts and filters without a server, with small tracks."""

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from math import cos, radians
from pathlib import Path
from typing import Any
from urllib.parse import quote

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
_SIZE = 64
_WIDE, _HIGH = 720, 320
_MOST_TITLES = 2000
"""Drives that the map names and draws as tracks; of more it shows where they begin."""


def write_index(folder: Path, entries: Iterable[Entry]) -> None:
    """The page; rows are data that its script draws as they come into view, so that thousands of them open at once."""
    ordered = sorted(entries, key=lambda one: one.key)
    rows = [_row(entry) for entry in ordered]
    assets = files("pipelines.archive") / "assets"
    head = "".join(f'<th data-key="{key}">{escape(title)}</th>' for key, title in _SHOWN)
    # a script ends at the first end tag, wherever it stands
    data = json.dumps(rows, separators=(",", ":")).replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    page = (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>Archive of {len(rows)} runs</title><style>{(assets / 'index.css').read_text('utf-8')}</style></head><body>"
        f'<header><h1>Archive of {len(rows)} runs</h1><input id="filter" type="search" placeholder="filter by any word">'
        f'<span id="count"></span></header><div id="map">{_map(ordered)}</div>'
        f'<div id="rows"><table><thead><tr><th>track</th>{head}</tr></thead><tbody></tbody></table></div>'
        f'<script type="application/json" id="data">{data}</script>'
        f"<script>{(assets / 'index.js').read_text('utf-8')}</script></body></html>\n"
    )
    write_whole(folder / NAME, lambda path: path.write_text(page, encoding="utf-8"))


def _row(entry: Entry) -> dict[str, Any]:
    row = {key: entry.row.get(key) for key, _ in _SHOWN}
    link = f"drives/{quote(entry.drive)}/{quote(entry.method)}/report.html" if entry.status == "done" else ""
    note = entry.reason or entry.row.get("first_finding", "")
    own = {"drive": entry.drive, "method": entry.method, "status": entry.status, "note": note, "link": link}
    return {**row, **own, "track": _path(entry.row.get("track") or [])}


def _path(track: Sequence[Sequence[float]]) -> str:
    """A track [deg] as the points of a polyline in a square."""
    if len(track) < 2:
        return ""
    shrink = cos(radians(track[0][0]))
    east, north = [lon * shrink for _, lon in track], [-lat for lat, _ in track]
    span = max(max(east) - min(east), max(north) - min(north)) or 1.0
    scale = (_SIZE - 8) / span
    return " ".join(
        f"{4 + (e - min(east)) * scale:.1f},{4 + (n - min(north)) * scale:.1f}" for e, n in zip(east, north, strict=True)
    )


def _map(entries: Sequence[Entry]) -> str:
    """All tracks in one picture, north up; a drive that is small in it is a dot."""
    tracks = {entry.drive: entry.row["track"] for entry in entries if entry.row.get("track")}
    points = [point for track in tracks.values() for point in track]
    if not points:
        return ""
    south, north = min(point[0] for point in points), max(point[0] for point in points)
    west, east = min(point[1] for point in points), max(point[1] for point in points)
    shrink = cos(radians((south + north) / 2))
    span = max((east - west) * shrink / _WIDE, (north - south) / _HIGH) or 1e-9
    drawn: dict[str, None] = {}
    for name, track in tracks.items():
        place = [((lon - west) * shrink / span + 6, (north - lat) / span + 6) for lat, lon in track]
        title = f"<title>{escape(name)}</title>" if len(tracks) <= _MOST_TITLES else ""
        if len(tracks) > _MOST_TITLES or max(abs(x - place[0][0]) + abs(y - place[0][1]) for x, y in place) < 2:
            drawn[f'<circle cx="{place[0][0]:.0f}" cy="{place[0][1]:.0f}" r="2.5">{title}</circle>'] = None
        else:
            corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in place)
            drawn[f'<polyline points="{corners}">{title}</polyline>'] = None
    label = f"tracks of {len(tracks)} drives, north up"
    return f'<svg viewBox="0 0 {_WIDE + 12} {_HIGH + 12}" role="img" aria-label="{label}">{"".join(drawn)}</svg>'
