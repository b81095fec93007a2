"""Ranges as JSON messages of our own layout, ``navreplay.GnssRanges``, one for each epoch."""

import json
from collections.abc import Iterator
from itertools import pairwise
from math import isnan
from typing import Any

from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.timeline import Floats, RangeSeries

__all__ = ["SCHEMA", "SCHEMA_NAME", "TOPIC", "range_messages"]

TOPIC = "/gnss/ranges"
SCHEMA_NAME = "navreplay.GnssRanges"
_NUMBER = {"type": ["number", "null"]}
_VECTOR = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
_SATELLITE: dict[str, Any] = {
    "sat": {"type": "string"},
    "signal": {"type": "string"},
    "pseudorange_m": {"type": "number"},
    "range_rate_mps": _NUMBER,
    "pseudorange_std_m": _NUMBER,
    "range_rate_std_mps": _NUMBER,
    "cn0_dbhz": _NUMBER,
    "sat_pos_e_m": _VECTOR,
    "sat_vel_e_mps": _VECTOR,
}
SCHEMA: dict[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": SCHEMA_NAME,
    "type": "object",
    "properties": {
        "t_gps_ns": {"type": "integer"},
        "satellites": {"type": "array", "items": {"type": "object", "properties": _SATELLITE, "required": list(_SATELLITE)}},
        "ionosphere_removed": {"type": "boolean"},
        "troposphere_removed": {"type": "boolean"},
        "klobuchar": {"type": ["array", "null"], "items": {"type": "number"}, "minItems": 8, "maxItems": 8},
        "corrected": {"type": "boolean"},
    },
    "required": ["t_gps_ns", "satellites", "ionosphere_removed", "troposphere_removed", "klobuchar", "corrected"],
}
"""JSON schema of a message. corrected: the pseudoranges contain satellite clock, relativity and group delay, and the satellite
states are in Earth-fixed axes of the time of reception."""


def range_messages(ranges: RangeSeries) -> Iterator[tuple[int, bytes]]:
    """UTC time [ns] and JSON text of every epoch; null where a number is unknown."""
    starts = ranges.epoch_starts.tolist()
    satellites = list(_satellites(ranges))
    times = ranges.t_ns[starts[:-1]]
    stamps = zip(times.tolist(), utc_from_gps(times).tolist(), strict=True)
    for (start, end), (t_ns, utc_ns) in zip(pairwise(starts), stamps, strict=True):
        message = {
            "t_gps_ns": t_ns,
            "satellites": satellites[start:end],
            "ionosphere_removed": ranges.ionosphere_removed,
            "troposphere_removed": ranges.troposphere_removed,
            "klobuchar": None if ranges.klobuchar is None else ranges.klobuchar.tolist(),
            "corrected": True,
        }
        yield utc_ns, json.dumps(message, separators=(",", ":"), allow_nan=False).encode()


def _satellites(ranges: RangeSeries) -> Iterator[dict[str, Any]]:
    columns = (
        ranges.sat.tolist(),
        ranges.signal.tolist(),
        ranges.pseudorange.tolist(),
        _or_null(ranges.range_rate),
        _or_null(ranges.pseudorange_std),
        _or_null(ranges.range_rate_std),
        _or_null(ranges.cn0),
        ranges.sat_pos_e.tolist(),
        ranges.sat_vel_e.tolist(),
    )
    for row in zip(*columns, strict=True):
        yield dict(zip(_SATELLITE, row, strict=True))


def _or_null(values: Floats) -> list[float | None]:
    return [None if isnan(value) else value for value in values.tolist()]
