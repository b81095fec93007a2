"""Ranges arranged for use: what is taken of them, corrected for the atmosphere, with the noise each is believed to have."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from navreplay.geodesy import earth
from navreplay.measurements.atmosphere import beidou_delay, klobuchar_delay, look_angles, saastamoinen_delay
from navreplay.options import RangeOptions
from navreplay.timeline import Floats, LogError, RangeSeries, Times

__all__ = ["RangeEpochs", "arrange_ranges", "clock_groups", "correct_ranges"]

_WEEK_NS = 604_800_000_000_000
_GPS_TIME = {"J": "G", "S": "G"}
"""QZSS and SBAS keep GPS time on GPS signals: they share the receiver's offset against it."""

_L1_MHZ = 1575.42
_BAND_MHZ = {
    "G": {"2": 1227.60, "5": 1176.45},
    "R": {"1": 1602.0, "2": 1246.0, "3": 1202.025, "4": 1600.995, "6": 1248.06},
    "E": {"5": 1176.45, "6": 1278.75, "7": 1207.14, "8": 1191.795},
    "C": {"2": 1561.098, "5": 1176.45, "6": 1268.52, "7": 1207.14, "8": 1191.795},
    "J": {"2": 1227.60, "5": 1176.45, "6": 1278.75},
}
"""Carriers by system and band of the RINEX code (RINEX 4.01, tables 4 to 10) other than L1; GLONASS without its channels."""


@dataclass(frozen=True, eq=False, slots=True)
class RangeEpochs:
    """Rows of one receiver in the order of time, at most one per satellite and epoch.

    t_ns: (e,) of the epochs. starts: (e + 1,) index of each epoch's first row, and the number of rows n. groups: names of the
    clock offsets, a constellation each; group: (n,) which of them a row has. sat: (n,). carrier: (n,) carrier over that of L1.
    pseudorange, range_rate, their standard deviations, cn0, sat_pos_e, sat_vel_e: as in RangeSeries; standard deviations are
    the receiver's, NaN where unknown, until `correct_ranges` fills them. elevation, azimuth: (n,) [rad], NaN until then.
    """

    t_ns: Times
    starts: NDArray[np.intp]
    groups: tuple[str, ...]
    group: NDArray[np.intp]
    sat: NDArray[np.str_]
    carrier: Floats
    pseudorange: Floats
    range_rate: Floats
    pseudorange_std: Floats
    range_rate_std: Floats
    cn0: Floats
    sat_pos_e: Floats
    sat_vel_e: Floats
    elevation: Floats
    azimuth: Floats

    @property
    def epoch_of(self) -> NDArray[np.intp]:
        """(n,) the epoch of each row."""
        return np.repeat(np.arange(len(self.t_ns)), np.diff(self.starts))

    def keep(self, rows: NDArray[np.bool_]) -> "RangeEpochs":
        """The same epochs with the rows where rows (n,) is True; epochs may become empty."""
        counts = np.add.reduceat(np.append(rows, False).astype(np.intp), self.starts[:-1])
        counts[np.diff(self.starts) == 0] = 0
        columns = {name: getattr(self, name)[rows] for name in _ROW_COLUMNS}
        return replace(self, starts=np.concatenate([[0], np.cumsum(counts)]), **columns)


_ROW_COLUMNS = (
    *("group", "sat", "carrier", "pseudorange", "range_rate", "pseudorange_std", "range_rate_std", "cn0"),
    *("sat_pos_e", "sat_vel_e", "elevation", "azimuth"),
)


def arrange_ranges(ranges: RangeSeries, options: RangeOptions) -> tuple[RangeEpochs, dict[str, int]]:
    """The rows that the options allow, and how many were left out for which reason.

    Raises LogError when none is left.
    """
    starts = ranges.epoch_starts
    epoch = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    weak = np.asarray(ranges.cn0 < options.cn0_mask)
    first = np.zeros(len(ranges), dtype=np.bool_)
    candidates = np.flatnonzero(~weak)
    _, satellite = np.unique(ranges.sat, return_inverse=True)
    _, place = np.unique(satellite[candidates] * len(starts) + epoch[candidates], return_index=True)
    first[candidates[place]] = True
    left_out = {
        f"below {options.cn0_mask:g} dB-Hz": int(weak.sum()),
        "of a satellite already seen in the epoch": int(len(candidates) - first.sum()),
    }
    if not first.any():
        raise LogError(
            f"ranges: all {len(ranges)} rows are weaker than {options.cn0_mask:g} dB-Hz; is the C/N0 in another unit? Lower "
            "range.cn0_mask_dbhz"
        )
    offsets = clock_groups(ranges.sat)
    groups = tuple(dict.fromkeys(np.array(offsets)[first].tolist()))
    unknown = np.full(len(ranges), np.nan)
    everything = RangeEpochs(
        t_ns=ranges.t_ns[starts[:-1]],
        starts=starts,
        groups=groups,
        group=np.array([groups.index(name) if name in groups else -1 for name in offsets], dtype=np.intp),
        sat=ranges.sat,
        carrier=_carriers(ranges.sat, ranges.signal),
        pseudorange=ranges.pseudorange,
        range_rate=ranges.range_rate,
        pseudorange_std=ranges.pseudorange_std,
        range_rate_std=ranges.range_rate_std,
        cn0=ranges.cn0,
        sat_pos_e=ranges.sat_pos_e,
        sat_vel_e=ranges.sat_vel_e,
        elevation=unknown,
        azimuth=unknown,
    )
    return everything.keep(first), {reason: count for reason, count in left_out.items() if count}


def clock_groups(sat: NDArray[np.str_]) -> list[str]:
    """(n,) letter of the constellation whose clock offset each satellite's range contains."""
    return [_GPS_TIME.get(letter, letter) for letter in sat.astype("U1").tolist()]


def _carriers(sat: NDArray[np.str_], signal: NDArray[np.str_]) -> Floats:
    keys, inverse = np.unique(np.char.add(sat.astype("U1"), signal.astype("U1")), return_inverse=True)
    ratios = [_BAND_MHZ.get(key[:1], {}).get(key[1:], _L1_MHZ) / _L1_MHZ for key in keys.tolist()]
    return np.array(ratios)[inverse]


def correct_ranges(
    epochs: RangeEpochs, ranges: RangeSeries, antenna_e: Floats, options: RangeOptions
) -> tuple[RangeEpochs, dict[str, int]]:
    """Epochs with delays of the atmosphere taken out, noise filled in and low satellites left out (counted by reason).

    antenna_e: (e, 3) about where the antenna is [m, Earth-fixed]; a kilometre to the side matters little, ten metres of height
    are 3 mm of zenith delay. ranges: where epochs came from, which tells what is corrected already.
    """
    lla = earth.lla_from_ecef(antenna_e)[epochs.epoch_of]
    elevation, azimuth = look_angles(lla, epochs.sat_pos_e)
    delay = np.zeros(len(elevation))
    if options.troposphere and not ranges.troposphere_removed:
        delay += saastamoinen_delay(lla[:, 0], lla[:, 2], elevation)
    if options.ionosphere and not ranges.ionosphere_removed and ranges.klobuchar is not None:
        tow_s = (epochs.t_ns[epochs.epoch_of] % _WEEK_NS) / 1e9
        model = beidou_delay if ranges.klobuchar_system == "C" else klobuchar_delay
        l1 = model(ranges.klobuchar, lla[:, 0], lla[:, 1], elevation, azimuth, tow_s)
        delay += l1 / epochs.carrier**2
    # a signal of unknown strength counts as a strong one
    weakness = 10 ** ((options.cn0_reference - np.nan_to_num(epochs.cn0, nan=np.inf)) / 10)
    factor, sine = np.sqrt(1 + weakness), np.sin(np.maximum(elevation, np.radians(3.0)))
    pseudorange_std = _believe(epochs.pseudorange_std, options.pseudorange_std * factor / sine, options.pseudorange_std_floor)
    rate_std = _believe(epochs.range_rate_std, options.range_rate_std * factor / np.sqrt(sine), options.range_rate_std_floor)
    corrected = replace(
        epochs,
        pseudorange=epochs.pseudorange - delay,
        pseudorange_std=pseudorange_std,
        range_rate_std=rate_std,
        elevation=elevation,
        azimuth=azimuth,
    )
    low = elevation < options.elevation_mask
    reason = f"below {np.degrees(options.elevation_mask):g} deg of elevation"
    return corrected.keep(~low), {reason: int(low.sum())} if low.any() else {}


def _believe(reported: Floats, modelled: Floats, least: float) -> Floats:
    return np.maximum(np.where(np.nan_to_num(reported) > 0, reported, modelled), least)
