"""The epoch loop: inertial propagation to each measurement, then its update. There is no other."""

from collections.abc import Callable

import numpy as np

from navreplay.error_models.considered import ConsideredModel
from navreplay.error_models.error_model import ErrorModel
from navreplay.filters.rows import Rows
from navreplay.filters.update import Estimator
from navreplay.mechanisation.strapdown import Leg, NavState, Steps
from navreplay.options import FilterOptions
from navreplay.timeline import Floats, LogError, Times

__all__ = ["DivergedError", "output_times", "run_epochs"]

_MOST_ROWS = 20_000_000
_DAY_NS = 86_400 * 10**9


class DivergedError(LogError):
    """The filter left the finite numbers."""


def run_epochs(
    steps: Steps,
    nodes: Times,
    t_ns: Times,
    epochs: np.ndarray,
    state: NavState,
    cov: Floats,
    estimator: Estimator,
    model: ErrorModel,
    options: FilterOptions,
    report: Callable[[int], None],
) -> Rows:
    """From state and cov (n, n) at the beginning of the steps over all nodes (k,), with updates at t_ns[epochs].

    Raises DivergedError where an update leaves the finite numbers.
    """
    ends = np.searchsorted(steps.t_ns, nodes) + 1
    rows = Rows.allocate(np.concatenate([[steps.start_ns], nodes]).astype(np.int64), state, cov, options.smooth)

    # each epoch ends a run of nodes; behind the last epoch one more run may follow, without a measurement
    node, step = 0, 0
    stops = (np.searchsorted(nodes, t_ns[epochs]) + 1).tolist()
    for epoch, stop in zip([*epochs.tolist(), None], [*stops, len(nodes)], strict=True):
        if stop > node:
            leg = Leg(steps, step, ends[node:stop], options.covariance_interval, options.smooth)
            moved = estimator.propagate(state, cov, leg)
            rows.put(slice(node + 1, stop + 1), moved)
            state, cov = NavState.unpack(moved.states[-1]), moved.covariances[-1]
            node, step = stop, int(ends[stop - 1])
        if epoch is not None:
            updated = estimator.update(epoch, state, cov, steps.dtheta[step - 1], float(steps.dt[step - 1]))
            rows.correct(node, updated)
            state, cov = updated.state, updated.cov
            if not np.isfinite(rows.states[node]).all():
                raise DivergedError(
                    f"its state is no longer a number {(t_ns[epoch] - steps.start_ns) / 1e9:.1f} s behind its start; the "
                    "likely cause is a covariance that grew without bound, of states that no measurement sees"
                )
            report(int(t_ns[epoch]))
            if updated.lost:
                rows = rows.until(node)
                break
    considered = len(model.kept) if isinstance(model, ConsideredModel) else 0
    return rows.smoothed(model, considered) if options.smooth else rows


def output_times(start_ns: int, end_ns: int, rate: float) -> Times:
    """Times of rows beside the epochs. Raises LogError where no memory would hold them."""
    if rate <= 0:
        return np.empty(0, dtype=np.int64)
    period = round(1e9 / rate)
    if (end_ns - start_ns) // period > _MOST_ROWS:
        raise LogError(
            f"filter: the measurements reach over {(end_ns - start_ns) / _DAY_NS:.4g} days, too long for rows at {rate:g} Hz; "
            "are their stamps right (is the week another column)? Otherwise set output.rate_hz lower"
        )
    return np.arange((start_ns // period + 1) * period, end_ns + 1, period, dtype=np.int64)
