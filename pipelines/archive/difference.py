"""What changed between two reprocessings of an archive: drive by drive, and over all drives with paired statistics."""

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from navreplay.geodesy.earth import ned_between
from navreplay.timeline import Floats, LogError, Times
from pipelines.archive.catalogue import read_catalogue
from pipelines.files.remote import local
from pipelines.trajectory.solution_csv import read_solution_csv

__all__ = ["Difference", "DriveChange", "FigureChange", "Separation", "compare_archives", "separate"]

FIGURES = (
    "horizontal_rms_m",
    "horizontal_p95_m",
    "height_rms_m",
    "position_nees",
    "position_nis",
    "std_horizontal_m",
    "used_share",
    "outage_end_median_m",
)
_BETTER_SMALLER = frozenset({"horizontal_rms_m", "horizontal_p95_m", "height_rms_m", "outage_end_median_m", "std_horizontal_m"})
_SURE = 2.0
"""Standard errors of a mean of paired changes beyond which it is no chance (95 %)."""


_UNKNOWN = (None, None, None, None, None)


@dataclass(frozen=True, eq=False, slots=True)
class Separation:
    """t_ns: (n,), GPS. lla: (n, 3) before [rad, rad, m]. ned_m: (n, 3) after minus before. track_m: (n, 3) NED of before, from
    its first position."""

    t_ns: Times
    lla: Floats
    ned_m: Floats
    track_m: Floats


@dataclass(frozen=True, slots=True)
class DriveChange:
    """One drive by one method. what: ``same``, ``changed``, ``only in A``, ``only in B``, ``fails now``, ``works now``.
    largest_m, rms_m: separation of the trajectories, and at_s, lat_deg, lon_deg: when, from the start, and where it is largest;
    None where they cannot be compared. figures: by name, before and after. causes: which hashes differ. settings: keys of the
    configuration that differ, as ``key: before -> after``."""

    drive: str
    method: str
    what: str
    largest_m: float | None
    rms_m: float | None
    at_s: float | None
    lat_deg: float | None
    lon_deg: float | None
    figures: dict[str, tuple[float | None, float | None]]
    causes: tuple[str, ...]
    settings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FigureChange:
    """One figure over the drives that have it in both: mean change with its standard error, relative mean, and the word for
    it."""

    figure: str
    drives: int
    mean: float
    error: float
    relative: float
    word: str


@dataclass(frozen=True, slots=True)
class Difference:
    """changes: the largest regression first. figures: over all drives."""

    changes: tuple[DriveChange, ...]
    figures: tuple[FigureChange, ...]

    def beyond(self, tolerance_m: float) -> tuple[DriveChange, ...]:
        """Drives that fail now, are gone, or whose trajectory moved by more than a tolerance [m]."""
        lost = ("fails now", "only in A")
        return tuple(one for one in self.changes if one.what in lost or (one.largest_m or 0.0) > tolerance_m)

    @property
    def settings(self) -> dict[str, int]:
        """Settings that differ, with the number of runs in which they do, the most frequent first."""
        return dict(Counter(text for one in self.changes for text in one.settings).most_common())

    def plain(self) -> dict[str, Any]:
        """Plain values for JSON."""
        changes, figures = [asdict(one) for one in self.changes], [asdict(one) for one in self.figures]
        return {"changes": changes, "figures": figures, "settings": self.settings}


def compare_archives(before: Path, after: Path) -> Difference:
    """Raises LogError where one of them is no archive, or none of their drives is the same."""
    rows = [
        {(row["drive"], row["method"]): row for row in read_catalogue(folder).to_dict("records")} for folder in (before, after)
    ]
    keys = sorted({*rows[0], *rows[1]})
    if not set(rows[0]) & set(rows[1]):
        raise LogError(f"{before} and {after}: no drive with the same name and method is in both")
    changes = [_compare(key, rows[0].get(key), rows[1].get(key), before, after) for key in keys]
    figures = [found for name in FIGURES if (found := _over_drives(name, changes)) is not None]
    return Difference(tuple(sorted(changes, key=_regression, reverse=True)), tuple(figures))


def _compare(
    key: tuple[str, str], old: dict[str, Any] | None, new: dict[str, Any] | None, before: Path, after: Path
) -> DriveChange:
    drive, method = key
    if old is None or new is None:
        return DriveChange(drive, method, "only in B" if old is None else "only in A", *_UNKNOWN, {}, ())
    causes = tuple(name for name in ("inputs", "config", "code") if old[name] != new[name])
    states = old["status"], new["status"]
    if states != ("done", "done"):
        what = {("done", "failed"): "fails now", ("failed", "done"): "works now"}.get(states, "same")
        return DriveChange(drive, method, what, *_UNKNOWN, {}, causes)
    measured = _measure(separate(before, after, drive, method))
    figures = {name: (_known(old[name]), _known(new[name])) for name in FIGURES}
    same = measured[0] == 0 and all(a == b for a, b in figures.values())
    settings = _changed_settings(before, after, drive, method) if "config" in causes else ()
    return DriveChange(drive, method, "same" if same else "changed", *measured, figures, causes, settings)


def _known(value: Any) -> float | None:
    return None if value is None or value != value else float(value)


def separate(before: Path, after: Path, drive: str, method: str) -> Separation | None:
    """How far the trajectories of a run are apart at the times that both have; None without such times. Raises LogError."""
    old, new = (read_solution_csv(_solution_of(folder, drive, method)) for folder in (before, after))
    t_ns, a, b = np.intersect1d(old.t_ns, new.t_ns, return_indices=True)
    if not len(a):
        return None
    lla = old.lla[a]
    return Separation(t_ns, lla, ned_between(lla, new.lla[b]), ned_between(lla[0], lla))


def _solution_of(folder: Path, drive: str, method: str) -> Path:
    """In the format that the run's own configuration names."""
    config = _read_toml(local(folder, f"drives/{drive}/{method}/config.toml"))
    return local(folder, f"drives/{drive}/{method}/solution.{config.get('output', {}).get('format', 'csv')}")


def _changed_settings(before: Path, after: Path, drive: str, method: str) -> tuple[str, ...]:
    old, new = (_flat(_read_toml(local(folder, f"drives/{drive}/{method}/config.toml"))) for folder in (before, after))
    keys = [key for key in sorted({*old, *new}) if old.get(key) != new.get(key)]
    return tuple(f"{key}: {old.get(key, 'unset')} -> {new.get(key, 'unset')}" for key in keys)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogError(f"{path}: cannot be read ({error}); process the drive again with --resume") from error


def _flat(values: Mapping[str, Any], under: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{under}{key}.") if isinstance(value, dict) else {f"{under}{key}": value}
    return flat


def _measure(apart: Separation | None) -> tuple[float | None, float | None, float | None, float | None, float | None]:
    """Largest and RMS separation [m], when [s] and where [deg] it is largest."""
    if apart is None:
        return _UNKNOWN
    distance = np.linalg.norm(apart.ned_m, axis=1)
    worst = int(np.argmax(distance))
    at_s = float(apart.t_ns[worst] - apart.t_ns[0]) / 1e9
    lat, lon = np.degrees(apart.lla[worst, :2])
    return float(distance[worst]), float(np.sqrt(np.mean(distance**2))), at_s, float(lat), float(lon)


def _regression(change: DriveChange) -> tuple[int, float, float]:
    """What stands first: drives that are lost, then those whose error grew most, then those that moved most."""
    lost = {"fails now": 3, "only in A": 2}.get(change.what, 1 if change.what == "changed" else 0)
    old, new = change.figures.get("horizontal_rms_m", (None, None))
    grown = (new - old) if old is not None and new is not None else 0.0
    return lost, grown, change.largest_m or 0.0


def _over_drives(name: str, changes: list[DriveChange]) -> FigureChange | None:
    pairs = [change.figures[name] for change in changes if name in change.figures]
    both = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not both:
        return None
    old, new = np.array(both).T
    steps = new - old
    mean = float(steps.mean())
    error = float(steps.std(ddof=1) / np.sqrt(len(steps))) if len(steps) > 1 else float("inf")
    relative = mean / float(np.abs(old).mean()) if old.any() else 0.0
    if not steps.any():
        word = "same"
    elif abs(mean) < _SURE * error or name not in _BETTER_SMALLER:
        word = "undecided" if abs(mean) < _SURE * error else "changed"
    else:
        word = "better" if mean < 0 else "worse"
    return FigureChange(name, len(both), mean, error, relative, word)
