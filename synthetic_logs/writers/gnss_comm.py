"""Ranges as messages of the ROS package gnss_comm, as its u-blox driver publishes them: raw, with broadcast ephemerides.

Conventions of the package (https://github.com/HKUST-Aerial-Robotics/gnss_comm): satellites are numbered GPS 1-32, GLONASS from
33, Galileo from 60, BeiDou from 98; times are GPS weeks and seconds, toe_tow and week those of the system; Doppler in Hz is
positive when the range shrinks; bit 0 of the status says that the pseudorange is valid.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from navreplay.geodesy.time_scales import WEEK_S, utc_from_gps
from navreplay.measurements.atmosphere import SPEED_OF_LIGHT
from navreplay.timeline import RangeSeries
from synthetic_logs.ranges.constellation import Orbits, ascending_node
from synthetic_logs.ranges.signals import carrier_of
from synthetic_logs.ranges.simulated import RangeTruth
from synthetic_logs.simulation import SyntheticLog, orbits_of
from synthetic_logs.writers.broadcast import AHEAD_S, WEEKS_BEFORE, issues

__all__ = ["DEFINITIONS", "TOPICS", "register_types", "satellite_number", "typed_messages"]

_EPHEMERIS_FIELDS = (
    *("ura", "A", "e", "i0", "omg", "OMG0", "M0", "delta_n", "OMG_dot", "i_dot", "cuc", "cus", "crc", "crs", "cic", "cis"),
    *("af0", "af1", "af2", "tgd0", "tgd1", "A_dot", "n_dot"),
)
_ELEMENTS = {
    "e": "eccentricity",
    "i0": "inclination",
    "omg": "perigee",
    "M0": "mean_anomaly",
    "delta_n": "delta_n",
    "OMG_dot": "node_rate",
    "i_dot": "inclination_rate",
    **{name: name for name in ("cuc", "cus", "crc", "crs", "cic", "cis", "af0", "af1")},
    "tgd0": "group_delay",
}
"""Fields that hold an element of `synthetic_logs.ranges.constellation.Orbits` as it is."""
_OBSERVED = ("freqs", "CN0", "LLI", "code", "psr", "psr_std", "cp", "cp_std", "dopp", "dopp_std", "status")
_BYTES = ("LLI", "code", "status")
DEFINITIONS = {
    "gnss_comm/msg/GnssTimeMsg": "uint32 week\nfloat64 tow\n",
    "gnss_comm/msg/GnssObsMsg": "GnssTimeMsg time\nuint32 sat\n"
    + "".join(f"{'uint8' if name in _BYTES else 'float64'}[] {name}\n" for name in _OBSERVED),
    "gnss_comm/msg/GnssMeasMsg": "GnssObsMsg[] meas\n",
    "gnss_comm/msg/GnssEphemMsg": "uint32 sat\nGnssTimeMsg ttr\nGnssTimeMsg toe\nGnssTimeMsg toc\nfloat64 toe_tow\n"
    + "".join(f"uint32 {name}\n" for name in ("week", "iode", "iodc", "health", "code"))
    + "".join(f"float64 {name}\n" for name in _EPHEMERIS_FIELDS),
    "gnss_comm/msg/StampedFloat64Array": "std_msgs/Header header\nfloat64[] data\n",
}
"""Fields of the messages, by ROS 2 name."""
TOPICS = {
    "/ublox_driver/iono_params": "gnss_comm/msg/StampedFloat64Array",
    "/ublox_driver/ephem": "gnss_comm/msg/GnssEphemMsg",
    "/ublox_driver/range_meas": "gnss_comm/msg/GnssMeasMsg",
}
_FIRST = {"G": 1, "E": 60, "C": 98}
_CODE = {"G": 1, "E": 1, "C": 47}
_PSEUDORANGE_VALID = 1
_S = 1_000_000_000


def register_types(store: Typestore) -> None:
    """Adds the messages to a store of standard types."""
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))


def satellite_number(sat: str) -> int:
    """The package's number of a satellite such as ``G05``."""
    return _FIRST[sat[0]] + int(sat[1:]) - 1


def typed_messages(log: SyntheticLog, store: Typestore) -> Iterator[tuple[str, int, Any]]:
    """Topic, UTC time [ns] and message: ionosphere and ephemerides at the start, then the ranges of every epoch. A log without
    ranges has none."""
    ranges, truth, receiver = log.ranges, log.range_truth, log.scenario.receiver
    if ranges is None or truth is None or receiver is None:
        return
    start_ns = int(utc_from_gps(ranges.t_ns[:1])[0])
    ionosphere, ephemeris, epochs = TOPICS
    if ranges.klobuchar is not None:
        header = _header(store, start_ns)
        yield ionosphere, start_ns, store.types[TOPICS[ionosphere]](header=header, data=ranges.klobuchar)
    for system, issue in issues(orbits_of(log.scenario.journey, receiver), log.scenario.journey):
        for row in range(len(issue)):
            yield ephemeris, start_ns, _ephemeris(store, system, issue, row)
    for t_ns, message in _epochs(store, ranges, truth):
        yield epochs, t_ns, message


def _header(store: Typestore, utc_ns: int) -> Any:
    stamp = store.types["builtin_interfaces/msg/Time"](sec=utc_ns // _S, nanosec=utc_ns % _S)
    header = store.types["std_msgs/msg/Header"]
    sequence = {"seq": 0} if "seq" in header.__annotations__ else {}
    return header(**sequence, stamp=stamp, frame_id="")


def _time(store: Typestore, t_ns: int) -> Any:
    week, rest_ns = divmod(t_ns, WEEK_S * _S)
    return store.types["gnss_comm/msg/GnssTimeMsg"](week=week, tow=rest_ns / _S)


def _ephemeris(store: Typestore, system: str, issue: Orbits, row: int) -> Any:
    toe = _time(store, issue.reference_ns)
    own_week, own_tow = divmod(issue.reference_ns // _S - AHEAD_S[system], WEEK_S)
    number = own_tow // 3600
    elements = {name: float(getattr(issue, attribute)[row]) for name, attribute in _ELEMENTS.items()}
    return store.types[TOPICS["/ublox_driver/ephem"]](
        sat=satellite_number(str(issue.sat[row])),
        ttr=_time(store, issue.reference_ns - 3600 * _S),
        toe=toe,
        toc=toe,
        toe_tow=float(own_tow),
        week=own_week - WEEKS_BEFORE[system],
        iode=number,
        iodc=number,
        health=0,
        code=0,
        ura=2.0,
        A=float(issue.sqrt_a[row] ** 2),
        OMG0=float(ascending_node(issue, AHEAD_S[system])[row]),
        af2=0.0,
        tgd1=float(issue.group_delay[row]) if system == "E" else 0.0,
        A_dot=0.0,
        n_dot=0.0,
        **elements,
    )


def _epochs(store: Typestore, ranges: RangeSeries, truth: RangeTruth) -> Iterator[tuple[int, Any]]:
    starts = ranges.epoch_starts.tolist()
    carrier = carrier_of(ranges.sat)
    hertz = carrier / SPEED_OF_LIGHT
    columns = {
        "freqs": carrier,
        "CN0": ranges.cn0,
        "LLI": np.zeros(len(ranges)),
        "code": np.array([_CODE[sat[0]] for sat in ranges.sat.tolist()]),
        "psr": ranges.pseudorange - truth.satellite_clock,
        "psr_std": ranges.pseudorange_std,
        "cp": np.zeros(len(ranges)),
        "cp_std": np.zeros(len(ranges)),
        "dopp": -(ranges.range_rate - truth.satellite_clock_rate) * hertz,
        "dopp_std": ranges.range_rate_std * hertz,
        "status": np.full(len(ranges), _PSEUDORANGE_VALID),
    }
    cells = {name: column.astype(np.uint8 if name in _BYTES else np.float64)[:, None] for name, column in columns.items()}
    observation, epoch = (store.types[f"gnss_comm/msg/{name}"] for name in ("GnssObsMsg", "GnssMeasMsg"))
    numbers = [satellite_number(sat) for sat in ranges.sat.tolist()]
    for (start, end), utc_ns in zip(pairwise(starts), utc_from_gps(ranges.t_ns[starts[:-1]]).tolist(), strict=True):
        time = _time(store, int(ranges.t_ns[start]))
        rows = range(start, end)
        meas = [observation(time=time, sat=numbers[row], **{name: cell[row] for name, cell in cells.items()}) for row in rows]
        yield utc_ns, epoch(meas=meas)
