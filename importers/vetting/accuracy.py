"""Told accuracy of positions against how quiet they are at their quietest: variances told as deviations, or deviations as
variances.

Third differences of positions pass on little of a motion, and at rest or in even motion nothing; so the quietest quarter of a
log bounds the noise from above. Only where the square, or the root, of what is told meets it while what is told does not is
anything said, and nothing is changed: the noise itself is found from the innovations.
"""

import numpy as np

from importers.findings import Finding
from navreplay.geodesy.earth import ned_between
from navreplay.timeline import GnssFixSeries

__all__ = ["check_told_accuracy"]

_LEAST_ROWS = 80
_ROWS = 16
_FAR = 4.0
_NEAR = 1.6
_LARGEST = 0.6
"""Standard deviations [m] above which square and root lie too near each other, or receivers smooth, to tell."""


def check_told_accuracy(fixes: GnssFixSeries) -> tuple[Finding, ...]:
    """A finding where the covariances look like standard deviations, or the other way about."""
    rows = np.flatnonzero(fixes.has_position & np.isfinite(fixes.cov_pos[:, 0, 0]))
    if len(rows) < _LEAST_ROWS:
        return ()
    told = float(np.sqrt(np.median(np.trace(fixes.cov_pos[rows, :2, :2], axis1=1, axis2=2)) / 2))
    place = ned_between(np.broadcast_to(fixes.lla[rows[0]], (len(rows), 3)), fixes.lla[rows])[:, :2]
    rough = np.abs(np.diff(place, 3, axis=0)).mean(axis=1) * 1.2533 / np.sqrt(20.0)
    whole = len(rough) // _ROWS * _ROWS
    seen = float(np.quantile(rough[:whole].reshape(-1, _ROWS).mean(axis=1), 0.25))
    if not 0 < told < _LARGEST or seen == 0 or max(seen / told, told / seen) < _FAR:
        return ()
    for meant, words in (
        (told**2, "its covariances seem to hold standard deviations"),
        (np.sqrt(told), "its standard deviations seem to hold variances"),
    ):
        if max(seen / meant, meant / seen) < _NEAR:
            text = (
                f"The positions are told to {told:.3g} m but scatter by {seen:.3g} m at their quietest, which is about "
                f"{meant:.3g} m: {words}."
            )
            hint = "The noise is found from the innovations (filter.name = 'checked'); mend it where the log is made."
            return (Finding("warning", "told-accuracy", text, hint),)
    return ()
