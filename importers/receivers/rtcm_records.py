"""What RTKLIB has decoded, in terms of this program: observations as columns, ephemerides as records."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from importers.rows.ranges import satellite_names
from importers.rows.signals import SPEED_OF_LIGHT, carrier_hz
from importers.satellites.ephemeris import GLONASS, KEPLER
from navreplay.geodesy.time_scales import GPS_EPOCH_UNIX_S

if TYPE_CHECKING:
    import pyrtklib

__all__ = ["Observations", "ephemeris_columns", "glonass_record", "kepler_record"]

_S = 1_000_000_000
_FREQUENCIES = 3
_SIGNAL_STRENGTH = 1e-3
_FNAV = 1 << 1
_GALILEO, _GLONASS = "E", "R"


def _ns(time: Any) -> int:
    """GPS time of RTKLIB's: whole seconds since 1970 without leap seconds, and their fraction."""
    return (int(time.time) - GPS_EPOCH_UNIX_S) * _S + round(float(time.sec) * 1e7) * 100


class Observations:
    """Observations collected epoch by epoch."""

    def __init__(self, library: "pyrtklib") -> None:
        self._library = library
        self._names: dict[int, str] = {}
        self._signals: dict[int, str] = {}
        self._rows: list[tuple[int, str, str, float, float, float, float]] = []

    def add(self, state: Any) -> None:
        """The epoch that a decoder has completed."""
        for place in range(state.obs.n):
            row = state.obs.data[place]
            t_ns, sat = _ns(row.time), self._name(row.sat)
            channel = float(state.nav.geph[int(sat[1:]) - 1].frq) if sat[:1] == _GLONASS and sat[1:] != "00" else 0.0
            for frequency in range(_FREQUENCIES):
                code = int(row.code[frequency])
                if code:
                    values = float(row.P[frequency]), float(row.D[frequency]), float(row.SNR[frequency]) * _SIGNAL_STRENGTH
                    self._rows.append((t_ns, sat, self._signal(code), *values, channel))

    def columns(self) -> dict[str, np.ndarray]:
        """Columns as `importers.rows.ranges.range_rows` takes them."""
        parts = list(zip(*self._rows, strict=True)) or [()] * 7
        sat, signal = satellite_names(np.array(parts[1], dtype="U3")), np.array(parts[2], dtype="U2")
        pseudorange, doppler, cn0, channel = (np.array(part, dtype=np.float64) for part in parts[3:])
        wave = SPEED_OF_LIGHT / carrier_hz(sat, signal, channel) if len(sat) else np.empty(0)
        return {
            "t_gps_ns": np.array(parts[0], dtype=np.int64),
            "sat": sat,
            "signal": signal,
            "pseudorange": np.where(pseudorange > 0, pseudorange, np.nan),
            "range_rate": np.where(doppler != 0, -doppler * wave, np.nan),
            "cn0": np.where(cn0 > 0, cn0, np.nan),
        }

    def _name(self, number: int) -> str:
        if number not in self._names:
            text = self._library.Arr1Dchar(4)
            self._library.satno2id(number, text)
            self._names[number] = text[0]
        return self._names[number]

    def _signal(self, code: int) -> str:
        if code not in self._signals:
            self._signals[code] = str(self._library.code2obs(code))
        return self._signals[code]


def kepler_record(library: "pyrtklib", state: Any) -> NDArray[np.void]:
    """The ephemeris that a decoder has completed, of any system but GLONASS."""
    text = library.Arr1Dchar(4)
    library.satno2id(state.ephsat, text)
    name = str(text[0])
    # RTKLIB keeps F/NAV behind I/NAV.
    eph = state.nav.eph[state.ephsat - 1 + state.ephset * _satellites(library)]
    record = np.zeros((), KEPLER)
    record["sat"] = name
    record["toe_ns"], record["toc_ns"] = _ns(eph.toe), _ns(eph.toc)
    record["toe_sow"], record["sqrt_a"] = eph.toes, np.sqrt(max(float(eph.A), 0.0))
    for own, theirs in _ELEMENTS.items():
        record[own] = getattr(eph, theirs)
    record["tgd"] = eph.tgd[0], 0.0 if name[0] in "GJ" else eph.tgd[1]
    record["health"] = eph.svh
    record["fnav"] = name[0] == _GALILEO and bool(int(eph.code) & _FNAV) and not int(eph.code) & 0b101
    return record


_ELEMENTS = {
    "af0": "f0", "af1": "f1", "af2": "f2", "e": "e", "m0": "M0", "delta_n": "deln", "i0": "i0", "idot": "idot",
    "omega0": "OMG0", "omega_dot": "OMGd", "omega": "omg", "cuc": "cuc", "cus": "cus", "crc": "crc", "crs": "crs",
    "cic": "cic", "cis": "cis",
}  # fmt: skip


def _satellites(library: "pyrtklib") -> int:
    return int(library.MAXSAT)


def glonass_record(library: "pyrtklib", state: Any) -> NDArray[np.void]:
    """The ephemeris of GLONASS that a decoder has completed."""
    text = library.Arr1Dchar(4)
    library.satno2id(state.ephsat, text)
    name = str(text[0])
    eph = state.nav.geph[int(name[1:]) - 1]
    record = np.zeros((), GLONASS)
    record["sat"], record["toe_ns"] = name, _ns(eph.toe)
    for axis in range(3):
        record["pos"][axis], record["vel"][axis], record["acc"][axis] = eph.pos[axis], eph.vel[axis], eph.acc[axis]
    record["tau"], record["gamma"], record["channel"], record["health"] = eph.taun, eph.gamn, eph.frq, eph.svh
    return record


def ephemeris_columns(kepler: NDArray[np.void], glonass: NDArray[np.void]) -> dict[str, np.ndarray]:
    """Columns as those of a navigation file: each row names its satellite in one of ``kepler`` and ``glonass``."""
    n, k = len(kepler) + len(glonass), len(kepler)
    columns = {"kepler": np.zeros(n, KEPLER), "glonass": np.zeros(n, GLONASS)}
    columns["kepler"][:k], columns["glonass"][k:] = kepler, glonass
    columns["klobuchar"], columns["klobuchar_system"] = np.full((n, 8), np.nan), np.full(n, "G")
    columns["t_gps_ns"] = np.concatenate([kepler["toe_ns"], glonass["toe_ns"]]).astype(np.int64)
    return columns
