"""Messages of the NovAtel driver that were decoded by the definitions of another release, as bags without any can be.

Releases differ in single bytes, so that a message still decodes while its fields are those beside. The codes of status and
type of solution are small and known (OEM7 Commands and Logs Reference Manual, BESTPOS, INSPVAX): random ones are a proof.
"""

from collections.abc import Mapping

import numpy as np

from navreplay.timeline import LogError

__all__ = ["check_release"]

_LARGEST_CODES = {"sol_status.status": 30, "pos_type.type": 100, "vel_type.type": 100, "ins_status.status": 30}
_SOLVED = 0
_NO_TYPE = 0


def check_release(columns: Mapping[str, np.ndarray], type: str) -> None:
    """Raises LogError where most messages (n,) hold codes that no receiver tells, or a solution without a type."""
    known = {name: columns[name].astype(np.int64) for name in _LARGEST_CODES if name in columns}
    if not known:
        return
    odd = np.logical_or.reduce([(codes < 0) | (codes > _LARGEST_CODES[name]) for name, codes in known.items()])
    place = next((columns[name].astype(np.float64) for name in ("lat", "latitude") if name in columns), None)
    if place is not None:
        odd |= ~(np.abs(place) <= 90)
    if place is not None and "pos_type.type" in known:
        odd |= (known["pos_type.type"] == _NO_TYPE) & (np.abs(place) > 1e-3)
    if np.mean(odd) > 0.5:
        found = ", ".join(f"{name} = {codes[np.flatnonzero(odd)[0]]}" for name, codes in known.items())
        raise LogError(
            f"laid out as another release of {type} than the definition that this program holds ({found}); record with "
            "definitions (MCAP, or a newer rosbag2)"
        )
