"""Heights in feet beside velocities in metres per second: the vertical velocity explains them wholly, at 0.3048 of their
change."""

from dataclasses import replace

import numpy as np

from importers.findings import Finding
from importers.vetting.motion_fit import fit, gather_windows
from importers.vetting.vetted import Vetted
from navreplay.timeline import GnssFixSeries

__all__ = ["heights_in_metres"]

_FOOT = 0.3048
_FITS = 0.05
_NEAR = 0.04
_LEAST_CLIMB = 10.0
"""Root mean square of the changes of height over a window [their unit] that are judged."""


def heights_in_metres(fixes: GnssFixSeries) -> Vetted:
    """The fixes with heights in metres, where velocities whose horizontal parts fit say that they are in feet."""
    windows = gather_windows(fixes) if fixes.has_velocity.any() else None
    if windows is None or np.sqrt(np.mean(windows.moved[:, 2] ** 2)) < _LEAST_CLIMB:
        return Vetted(fixes)
    flat = fit(*(part[:, :2].T.ravel() for part in windows[:3]), windows.apart)
    steep = fit(*(part[:, 2] for part in windows[:3]), windows.apart)
    level = abs(flat.scale - 1) < _NEAR and flat.left < _FITS
    if not level or steep.left > _FITS or abs(steep.scale / _FOOT - 1) > _NEAR:
        return Vetted(fixes)
    text = (
        f"The heights change {1 / steep.scale:.2f} times as much as the vertical velocity says, while the horizontal motion "
        f"fits: they are in feet (the first is {fixes.lla[np.flatnonzero(fixes.has_position)[0], 2]:.1f})."
    )
    finding = Finding("warning", "heights-in-feet", text, "They are taken so; convert them where the log is made or mapped.")
    return Vetted(replace(fixes, lla=fixes.lla * [1.0, 1.0, _FOOT]), (finding,))
