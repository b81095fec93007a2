"""A track as a map can show it: courses with their times, and what to colour them by."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["Course", "Shading", "Track", "thin_course"]

_MOST_POINTS = 12_000


@dataclass(frozen=True, eq=False, slots=True)
class Shading:
    """Values (n,) along a course with their unit; classes: the names of whole numbers from 1 on, where they are grades."""

    values: Floats
    unit: str
    classes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Course:
    """Points over time. t_s, east, north: (n,) [s, m, m]. style: class of the style sheet. shades: by name."""

    kind: Literal["line", "dots", "crosses"]
    t_s: Floats
    east: Floats
    north: Floats
    style: str
    name: str
    shades: Mapping[str, Shading] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """Courses from the lowest to the topmost, about an origin at lat_deg, lon_deg."""

    lat_deg: float
    lon_deg: float
    courses: tuple[Course, ...]


def thin_course(t_s: Floats, east: Floats, north: Floats, worst: Floats | None = None) -> NDArray[np.intp]:
    """Which of n points a map needs: as many as it can show, evenly spaced, and of each stretch the one with the largest value
    of worst (n,); points at unknown places are left out."""
    known = np.flatnonzero(np.isfinite(t_s) & np.isfinite(east) & np.isfinite(north))
    if len(known) <= _MOST_POINTS:
        return known
    edges = np.linspace(0, len(known), _MOST_POINTS // 2 + 1).astype(int)
    kept = [known[edges[:-1]], known[-1:]]
    if worst is not None:
        values = np.where(np.isfinite(worst[known]), worst[known], -np.inf)
        kept.append(known[[low + int(np.argmax(values[low:high])) for low, high in pairwise(edges.tolist())]])
    return np.unique(np.concatenate(kept))
