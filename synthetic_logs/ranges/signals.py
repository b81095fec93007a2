"""The signals of the constellation, one for each system."""

import numpy as np
from numpy.typing import NDArray

from navreplay.timeline import Floats

__all__ = ["CARRIER_HZ", "SIGNALS", "carrier_of", "signal_of", "system_of"]

SIGNALS = {"G": "1C", "E": "1C", "C": "2I"}
"""RINEX code by system: GPS L1 C/A, Galileo E1, BeiDou B1I."""
CARRIER_HZ = {"G": 1575.42e6, "E": 1575.42e6, "C": 1561.098e6}


def system_of(sat: NDArray[np.str_]) -> NDArray[np.str_]:
    """System letters (k,) of satellites (k,) such as ``G05``."""
    return sat.astype("U1")


def signal_of(sat: NDArray[np.str_]) -> NDArray[np.str_]:
    """RINEX codes (k,) of the signals of satellites (k,)."""
    return np.array([SIGNALS[system] for system in system_of(sat).tolist()])


def carrier_of(sat: NDArray[np.str_]) -> Floats:
    """Carriers (k,) [Hz] of the signals of satellites (k,)."""
    return np.array([CARRIER_HZ[system] for system in system_of(sat).tolist()])
