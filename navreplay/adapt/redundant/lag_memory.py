"""What is remembered of every component: its differences over several lags, and its level against the others.

A component's path is the sum of its differences over one epoch each (`trails`), in units of the told standard deviation, from
where it last began anew. Half the square of its change over a lag is one value of v_L, which stands for as many seconds as
there are between epochs: rates of 1 Hz and of 5 Hz are remembered for as long, and cost as much. Values are summed up in
blocks of time, of which those within the window count.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navreplay.adapt.redundant.trails import difference_steps, remove_common
from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation

__all__ = ["LAGS", "LagMemory", "add_levels", "extend_memory", "forget", "rows_of"]

LAGS = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""[s]. Each counts alike, which along a geometric series is what weights of 1 / L are among all lags: short lags have more
independent values."""
_ROUNDING = 1e-6
_BLOCKS = 10


class LagMemory(NamedTuple):
    """rows: index of each label among the k that were ever seen. t_ns: the last epoch. t_s (n,): epochs back to the longest
    lag, against t_ns [s]. path (k, n): NaN where there is none. told (k,): variance at the last epoch; NaN where the label was
    not in it. starts (b,): of blocks of time, against t_ns [s]; the last is still filling. sums, weights (b, k, lags + 1): of
    v_L and, in the last column, of the squared level, times their weights [s]; and the weights. ratio (k,): estimated over
    told variance; NaN of what is new."""

    rows: Mapping[str, int]
    t_ns: int
    t_s: Floats
    path: Floats
    told: Floats
    starts: Floats
    sums: Floats
    weights: Floats
    ratio: Floats


def forget() -> LagMemory:
    """Nothing seen yet."""
    empty, table = np.zeros(0), np.zeros((0, 0, len(LAGS) + 1))
    return LagMemory({}, 0, empty, np.zeros((0, 0)), empty, empty, table, table, empty)


def rows_of(memory: LagMemory, labels: tuple[str, ...]) -> NDArray[np.intp]:
    """Where in the memory labels (m,) are."""
    return np.array([memory.rows[label] for label in labels], dtype=np.intp)


def extend_memory(memory: LagMemory, innovation: Innovation, window: float, longest_step: float) -> LagMemory:
    """The memory with the paths and v_L of this epoch. window [s]; no step is longer than longest_step [s]."""
    elapsed = (innovation.t_ns - memory.t_ns) / 1e9
    seen = {label: memory.t_ns for label, row in memory.rows.items() if memory.told[row] == memory.told[row]}
    memory = _make_room(memory, innovation.labels)
    here, told = rows_of(memory, innovation.labels), np.diagonal(innovation.noise)
    step = remove_common(innovation.labels, difference_steps(seen, innovation, longest_step), told)
    path, t_s = _walk(memory, here, step / np.sqrt((told + memory.told[here]) / 2), elapsed)
    starts, sums, weights = _turn_page(memory, elapsed, window)
    for column, at in enumerate(_epochs_before(t_s)):
        if at >= 0:
            change = path[:, -1] - path[:, at]
            known = np.isfinite(change)
            sums[-1, known, column] += elapsed * change[known] ** 2 / 2
            weights[-1, known, column] += elapsed
    now = np.full(len(memory.rows), np.nan)
    now[here] = told
    return LagMemory(memory.rows, innovation.t_ns, t_s, path, now, starts, sums, weights, memory.ratio)


def add_levels(
    memory: LagMemory, here: NDArray[np.intp], squares: Floats, shares: Floats, ratio: Floats, interval: float
) -> LagMemory:
    """The memory with squares (m,) whose expectations are shares (m,) where the noise has ratio (m,) to the told variance, in
    rows here (m,). interval [s]: what they stand for."""
    sums, weights = memory.sums.copy(), memory.weights.copy()
    sums[-1, here, -1] += interval * squares * ratio
    weights[-1, here, -1] += interval * shares
    return memory._replace(sums=sums, weights=weights)


def _epochs_before(t_s: Floats) -> list[int]:
    """By lag the index of the epoch that lies it before the last of t_s (n,) [s], to half a step and a quarter of the lag, -1
    where there is none."""
    if len(t_s) < 2:
        return [-1] * len(LAGS)
    after = np.clip(np.searchsorted(t_s, -LAGS), 1, len(t_s) - 1)
    nearest = np.minimum(np.where(-LAGS - t_s[after - 1] < t_s[after] + LAGS, after - 1, after), len(t_s) - 2)
    found = np.abs(t_s[nearest] + LAGS) <= np.minimum(-0.5 * t_s[-2], LAGS / 4) + _ROUNDING
    return np.where(found, nearest, -1).tolist()


def _make_room(memory: LagMemory, labels: tuple[str, ...]) -> LagMemory:
    """The memory with rows for labels that are new."""
    new = [label for label in labels if label not in memory.rows]
    if not new:
        return memory
    k = len(memory.rows)
    blocks, _, columns = memory.sums.shape
    unknown, nothing = np.full(len(new), np.nan), np.zeros((blocks, len(new), columns))
    return memory._replace(
        rows={**memory.rows, **{label: k + i for i, label in enumerate(new)}},
        path=np.concatenate([memory.path, np.full((len(new), len(memory.t_s)), np.nan)]),
        told=np.concatenate([memory.told, unknown]),
        sums=np.concatenate([memory.sums, nothing], axis=1),
        weights=np.concatenate([memory.weights, nothing], axis=1),
        ratio=np.concatenate([memory.ratio, unknown]),
    )


def _walk(memory: LagMemory, here: NDArray[np.intp], step: Floats, elapsed: float) -> tuple[Floats, Floats]:
    """Paths (k, n) and their epochs (n,) [s] with step (m,) of the rows here (m,); where it is NaN a path begins anew."""
    t_s = memory.t_s - elapsed
    kept = t_s >= -LAGS[-1] - elapsed
    past, now = memory.path[:, kept], np.full((len(memory.path), 1), np.nan)
    if past.shape[1]:
        now[here, 0] = past[here, -1] + step
    anew = here[np.isnan(now[here, 0])]
    past[anew], now[anew] = np.nan, 0.0
    return np.concatenate([past, now], axis=1), np.append(t_s[kept], 0.0)


def _turn_page(memory: LagMemory, elapsed: float, window: float) -> tuple[Floats, Floats, Floats]:
    """Starts (b,) and tables (b, k, lags + 1) without blocks that began window [s] ago, and with one to fill."""
    starts = memory.starts - elapsed
    kept = starts > -window
    starts, sums, weights = starts[kept], memory.sums[kept], memory.weights[kept]
    if len(starts) and starts[-1] > -window / _BLOCKS:
        return starts, sums, weights
    page = np.zeros((1, *sums.shape[1:]))
    return np.append(starts, 0.0), np.concatenate([sums, page]), np.concatenate([weights, page])
