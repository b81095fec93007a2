"""TUM trajectories: ``timestamp x y z qx qy qz qw`` in a local frame, as tools for comparing trajectories write them."""

import numpy as np

from importers.rows.clock import count_ns, is_time
from importers.rows.log import Table
from importers.rows.tables import drop_absurd
from importers.text.table import parse_text, read_bytes, select_columns
from navreplay.timeline import LogError

__all__ = ["is_tum", "read_tum"]


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
    timed = is_time(values[:, 0])
    rejected = dict(selection.rejected) | ({} if timed.all() else {"no time": int((~timed).sum())})
    stamps = count_ns(values[timed, 0], "s")
    values = drop_absurd(values[timed])
    columns = {"stamp": stamps, "local": values[:, 1:4], "q": values[:, [7, 4, 5, 6]]}
    return Table(stamps, columns, selection.read, rejected)
