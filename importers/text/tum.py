"""TUM trajectories: ``timestamp x y z qx qy qz qw`` in a local frame, as tools for comparing trajectories write them."""

import numpy as np

from importers.rows.clock import count_ns, is_time
from importers.rows.log import Table
from importers.rows.tables import drop_absurd
from importers.text.table import parse_text, read_bytes, select_columns
from importers.text.times import unit_of_counts
from navreplay.timeline import Floats, LogError

__all__ = ["is_tum", "read_tum"]

_LEVEL = 0.5
_MOST, _FEW = 0.9, 0.5
_LEAST_MOVES = 10
_CLEARLY, _LEAST_SPREAD = 4.0, 0.002


def is_tum(head: str) -> bool:
    """Whether the first full line that is not a comment holds eight numbers, the last four a unit quaternion."""
    rows = [line.split() for line in head.splitlines()[:20] if line.strip() and not line.startswith("#")]
    try:
        values = np.array(rows[0], dtype=np.float64) if rows else np.empty(0)
    except ValueError:
        return False
    return len(values) == 8 and abs(float(np.linalg.norm(values[4:])) - 1) < 1e-2


def read_tum(path: str) -> Table:
    """Stamps in nanoseconds of an unsaid base, positions east, north, up of an origin, attitudes. Raises LogError."""
    text = parse_text(read_bytes(path), delimiter=" ", header=False, comment="#")
    if text.frame.shape[1] != 8:
        raise LogError(f"{path}: a TUM trajectory has 8 columns, this file {text.frame.shape[1]}")
    selection = select_columns(text, {str(i): i for i in range(8)})
    values = np.column_stack([selection.columns[str(i)] for i in range(8)]).astype(np.float64)
    unit = unit_of_counts(values[:, 0], "utc", path)
    timed = is_time(values[:, 0], unit)
    rejected = dict(selection.rejected) | ({} if timed.all() else {"no time": int((~timed).sum())})
    stamps = count_ns(values[timed, 0], unit)
    values = np.column_stack([values[timed, 0], drop_absurd(values[timed, 1:])])
    last, note = _scalar_is_last(values)
    columns = {"stamp": stamps, "local": values[:, 1:4], "q": values[:, [7, 4, 5, 6] if last else [4, 5, 6, 7]]}
    return Table(stamps, columns, selection.read, rejected, (note,) if note else ())


def _scalar_is_last(values: Floats) -> tuple[bool, str]:
    """Whether the quaternions of rows (n, 8) end with their scalar, as TUM has it, and what is told of it. A vehicle stays
    about level, and its course keeps its angle to its heading: where just one of the orders says so, that is meant."""
    known = values[np.isfinite(values).all(axis=1)]
    if len(known) < 2:
        return True, ""
    orders = {True: known[:, [7, 4, 5, 6]], False: known[:, 4:]}
    level = {last: float(np.mean(1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2) > _LEVEL)) for last, q in orders.items()}
    if max(level.values()) > _MOST and min(level.values()) < _FEW:
        return _told(level[True] > level[False], "the vehicle stays level", known)
    steady = {last: _steadiness(known[:, 1:3], q) for last, q in orders.items()}
    if max(steady.values()) > _MOST and 1 - min(steady.values()) > _CLEARLY * (1 - max(steady.values())) + _LEAST_SPREAD:
        return _told(steady[True] > steady[False], "course and heading agree", known)
    return True, f"its quaternions are taken as qx qy qz qw; rows such as {_shown(known[-1])} would fit qw qx qy qz as well"


def _told(last: bool, why: str, known: Floats) -> tuple[bool, str]:
    first = f"its quaternions are taken as qw qx qy qz, against the order of TUM: only so {why} (row {_shown(known[-1])})"
    return last, "" if last else first


def _shown(row: Floats) -> str:
    return "'" + " ".join(f"{value:.12g}" for value in row) + "'"


def _steadiness(places: Floats, q: Floats) -> float:
    """How constant the angle between the course of places (n, 2) and the heading of attitudes (n, 4) is: 0 to 1; 0 where the
    places do not move."""
    step = max(len(places) // 200, 1)
    moved = places[step:] - places[:-step]
    q = q[: len(moved)]
    length = np.linalg.norm(moved, axis=1)
    moving = length > max(0.2 * float(length.max(initial=0.0)), 1e-3)
    if moving.sum() < _LEAST_MOVES:
        return 0.0
    heading = np.arctan2(2 * (q[:, 0] * q[:, 3] + q[:, 1] * q[:, 2]), 1 - 2 * (q[:, 2] ** 2 + q[:, 3] ** 2))
    angle = np.arctan2(moved[:, 1], moved[:, 0]) - heading
    return float(np.abs(np.mean(np.exp(1j * angle[moving]))))
