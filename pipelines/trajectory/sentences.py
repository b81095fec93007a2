"""The trajectory as NMEA 0183 sentences, as GPX, and its deviations as the smrmsg beside an SBET."""

from functools import reduce
from operator import xor
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from navreplay.geodesy.time_scales import week_tow_from_gps
from pipelines.trajectory.solution_csv import SolutionTable, utc_text

__all__ = ["write_gpx", "write_nmea", "write_smrmsg"]

_KNOT = 1852 / 3600
_ESTIMATED = 6
"""GGA's quality of dead reckoning; rows whose position a measurement has corrected have 1."""


def write_nmea(path: Path, table: SolutionTable) -> None:
    """GGA and RMC per row (NMEA 0183). The height is ellipsoidal and the separation of the geoid 0, so that their sum is right;
    number of satellites and dilution are empty."""
    speed = np.hypot(table.vel_n[:, 0], table.vel_n[:, 1]) / _KNOT
    course = np.degrees(np.arctan2(table.vel_n[:, 1], table.vel_n[:, 0])) % 360
    degrees = np.degrees(table.lla[:, :2]).tolist()
    rows = zip(
        utc_text(table.t_ns), degrees, table.lla[:, 2].tolist(), speed.tolist(), course.tolist(), table.status, strict=True
    )
    with path.open("w", encoding="ascii", newline="") as file:
        for utc, (lat, lon), height, knots, track, status in rows:
            clock, date = f"{utc[11:13]}{utc[14:16]}{utc[17:23]}", f"{utc[8:10]}{utc[5:7]}{utc[2:4]}"
            where = f"{_angle(lat, 2, 'NS')},{_angle(lon, 3, 'EW')}"
            quality = _ESTIMATED if status in ("predicted", "rejected") else 1
            mode = "E" if quality == _ESTIMATED else "A"
            file.write(_sentence(f"GNGGA,{clock},{where},{quality},,,{height:.3f},M,0.0,M,,"))
            file.write(_sentence(f"GNRMC,{clock},A,{where},{knots:.3f},{track:.3f},{date},,,{mode}"))


def _angle(degrees: float, digits: int, marks: str) -> str:
    """Degrees and minutes to 1e-7 minutes, 0.2 mm."""
    whole, minutes = divmod(round(abs(degrees) * 60e7), 60 * 10**7)
    return f"{whole:0{digits}d}{minutes / 1e7:010.7f},{marks[degrees < 0]}"


def _sentence(body: str) -> str:
    return f"${body}*{reduce(xor, body.encode('ascii')):02X}\r\n"


def write_gpx(path: Path, table: SolutionTable) -> None:
    """A track of GPX 1.1. Its elevations are ellipsoidal, with a geoidheight of 0."""
    degrees = np.degrees(table.lla[:, :2]).tolist()
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write('<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.1" creator="navreplay"')
        file.write(f" xmlns={quoteattr('http://www.topografix.com/GPX/1/1')}><trk><name>navreplay trajectory</name>")
        file.write("<desc>Heights are ellipsoidal (WGS 84).</desc><trkseg>\n")
        for utc, (lat, lon), height in zip(utc_text(table.t_ns), degrees, table.lla[:, 2].tolist(), strict=True):
            place = f'lat="{lat:.9f}" lon="{lon:.9f}"'
            file.write(f"<trkpt {place}><ele>{height:.4f}</ele><time>{utc}</time><geoidheight>0</geoidheight></trkpt>\n")
        file.write("</trkseg></trk></gpx>\n")


def write_smrmsg(path: Path, table: SolutionTable) -> None:
    """Ten little-endian doubles per row, as POSPac writes them beside an SBET: seconds of the GPS week; deviations of position
    north, east, down [m], of velocity [m/s], of roll, pitch, heading [arcmin]."""
    _, tow = week_tow_from_gps(table.t_ns)
    records = np.zeros((len(table), 10), dtype="<f8")
    records[:, 0], records[:, 1:7], records[:, 7:] = tow, table.std[:, :6], np.degrees(table.std[:, 6:9]) * 60
    path.write_bytes(records.tobytes())
