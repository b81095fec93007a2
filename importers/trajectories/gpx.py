"""GPX tracks as fixes: positions, heights and times; the format has no accuracies and no velocities.

Source: GPX 1.1 schema (topografix.com). Times are UTC. Heights are above mean sea level as receivers write them; a geoid height
of the same point makes them ellipsoidal.
"""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from importers.rows.log import Table
from importers.rows.tables import NO_FIX
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import FixStatus, LogError

__all__ = ["is_gpx", "read_gpx"]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_SECOND = 1_000_000_000
_STATUS = {"none": NO_FIX, "2d": int(FixStatus.SINGLE), "3d": int(FixStatus.SINGLE), "dgps": int(FixStatus.DIFFERENTIAL)}
_Point = tuple[int, float, float, float, int]


def is_gpx(head: str) -> bool:
    """Whether the beginning of a file is a GPX document."""
    return head.lstrip().startswith(("<?xml", "<gpx")) and "<gpx" in head


def read_gpx(path: str, leap: LeapSeconds) -> Table:
    """One row per track point with a time. Raises LogError where there is none."""
    points: list[_Point] = []
    rejected: dict[str, int] = {}
    total = 0
    try:
        for point in _track_points(path):
            total += 1
            if point is None:
                rejected["without a time, or no position"] = rejected.get("without a time, or no position", 0) + 1
            else:
                points.append(point)
    except ElementTree.ParseError as error:
        if not points:
            raise LogError(f"{path}: is no readable GPX document: {error}; copy the file again") from error
        rejected[f"damaged from line {error.position[0]} on"] = 1
        total += 1
    except (LookupError, ValueError) as error:
        raise LogError(f"{path}: declares an encoding that cannot be read: {error}") from error
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    if not points:
        raise LogError(
            f"{path}: holds no track point with a time ({total} without); a planned route has none, and cannot serve as fixes"
        )
    stamps, lat, lon, height, status = (np.array(values) for values in zip(*points, strict=True))
    t_ns = gps_from_utc(stamps.astype(np.int64), leap)
    lla = np.column_stack([np.radians(lat), np.radians(lon), height]).astype(np.float64)
    return Table(t_ns, {"t_gps_ns": t_ns, "lla": lla, "status": status.astype(np.int8)}, total, rejected)


def _track_points(path: str) -> Iterator[_Point | None]:
    """Track points in the order of the file, None for those that cannot be used. A document type is refused: entities are how
    small documents become huge ones."""
    with Path(path).open("rb") as file:
        if b"<!DOCTYPE" in file.read(20_000):
            raise LogError(f"{path}: declares a document type, which GPX has none of; it is not read")
        file.seek(0)
        for _, element in ElementTree.iterparse(file):
            if _name(element) == "trkpt":
                yield _point(element)
                element.clear()


def _name(element: ElementTree.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _point(element: ElementTree.Element) -> _Point | None:
    parts = {_name(child): (child.text or "").strip() for child in element}
    try:
        lat, lon = float(element.attrib["lat"]), float(element.attrib["lon"])
        height = float(parts["ele"]) + float(parts.get("geoidheight") or 0.0) if parts.get("ele") else 0.0
        time = datetime.fromisoformat(parts["time"])
    except (KeyError, ValueError):
        return None
    if not 1980 <= time.year < 2200:
        return None
    since = (time if time.tzinfo is not None else time.replace(tzinfo=UTC)) - _EPOCH
    stamp = (since.days * 86_400 + since.seconds) * _SECOND + since.microseconds * 1000
    return stamp, lat, lon, height, _STATUS.get(parts.get("fix", ""), int(FixStatus.UNKNOWN))
