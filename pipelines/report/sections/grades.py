"""Quality grades from 1 to 6 by the size of a horizontal error, and stretches of one grade."""

import numpy as np

from navreplay.timeline import Floats

__all__ = ["BOUNDS_M", "GRADES", "grade_of"]

BOUNDS_M = (0.05, 0.2, 0.5, 1.5, 5.0)
"""Upper bounds of the grades 1 to 5; what lies beyond is 6."""
GRADES = (*(f"{grade}: up to {bound:g} m" for grade, bound in enumerate(BOUNDS_M, start=1)), f"6: over {BOUNDS_M[-1]:g} m")


def grade_of(horizontal: Floats) -> Floats:
    """Grades (n,) of horizontal errors or sigmas (n,) [m]; NaN where they are unknown."""
    grades = 1.0 + np.searchsorted(BOUNDS_M, horizontal, side="left")
    return np.where(np.isfinite(horizontal), grades, np.nan)
