"""Sound small logs of every format, as sets of files of which one can be damaged."""

import gzip
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from synthetic_logs import SCENARIOS, SyntheticLog, simulate, with_duration, write
from tests.field.promise import DRIVES
from tests.field.strangers import messages, tables
from tests.importers import test_same_drive as streams
from tests.importers.rinex.test_rinex import sp3_text

__all__ = ["SETS", "make"]

_SECONDS = 12.0
Maker = Callable[[Path], list[str]]


def _log(drive: str = "town") -> SyntheticLog:
    return simulate(with_duration(DRIVES[drive], _SECONDS), 1)


def _written(suffix: str, scenario: str = "car-short") -> Maker:
    def make(folder: Path) -> list[str]:
        """A synthetic log in one of the formats that are written."""
        log = simulate(with_duration(SCENARIOS[scenario], _SECONDS if scenario == "car-short" else 3.0), 1)
        return [path.name for path in write(log, folder / f"log{suffix}")[:-1]]

    return make


def _stream(name: str) -> Maker:
    def make(folder: Path) -> list[str]:
        """The same drive in the stream of a receiver or autopilot, its first part."""
        content = streams.STREAMS[name][0]()
        (folder / name).write_bytes(content[: len(content) // 2])
        return [name]

    return make


def _stranger(write_one: Callable[[SyntheticLog, Path], list[str]], drive: str = "town") -> Maker:
    return lambda folder: write_one(_log(drive), folder)


def _packed(folder: Path) -> list[str]:
    (name,) = _written(".mcap")(folder)
    content = (folder / name).read_bytes()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    (folder / "log.zip").write_bytes(buffer.getvalue())
    return ["log.zip"]


def _gzipped(folder: Path) -> list[str]:
    imu, fix = tables.gps_seconds(_log(), folder)
    (folder / "fix.csv.gz").write_bytes(gzip.compress((folder / fix).read_bytes()))
    return ["fix.csv.gz", imu]


def _with_imu(name: str, text: Callable[[SyntheticLog], str]) -> Maker:
    def make(folder: Path) -> list[str]:
        """A text beside an IMU."""
        log = _log()
        (folder / name).write_text(text(log))
        return [name, tables.gps_seconds(log, folder)[0]]

    return make


def _pos(log: SyntheticLog) -> str:
    assert log.fixes is not None
    head = "%  GPST  latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
    rows = [
        f"{t // 604_800_000_000_000} {t % 604_800_000_000_000 / 1e9:.3f} {np.degrees(lla[0]):.9f} {np.degrees(lla[1]):.9f} "
        f"{lla[2]:.3f} 5 9 1.5 1.5 2.5 0 0 0 0 0"
        for t, lla in zip(log.fixes.t_ns.tolist(), log.fixes.lla, strict=True)
    ]
    return "\n".join([head, *rows]) + "\n"


def _gpx(log: SyntheticLog) -> str:
    assert log.fixes is not None
    points = "".join(
        f'<trkpt lat="{np.degrees(lla[0]):.8f}" lon="{np.degrees(lla[1]):.8f}"><ele>{lla[2]:.2f}</ele>'
        f"<time>2024-03-05T10:33:{i + 2:02d}Z</time></trkpt>"
        for i, lla in enumerate(log.fixes.lla)
    )
    return f'<?xml version="1.0"?><gpx version="1.1"><trk><trkseg>{points}</trkseg></trk></gpx>'


def _tum(log: SyntheticLog) -> str:
    rows = [f"{1_709_634_782 + i * 0.1:.3f} {i} {2 * i} 0.5 0 0 0 1" for i in range(100)]
    return "\n".join(rows) + "\n"


def _sp3(folder: Path) -> list[str]:
    names = _written(".obs", "ranges-open")(folder)
    (folder / "orbits.sp3").write_text(sp3_text(12, 1_393_670_000 * 10**9))
    return ["orbits.sp3", *names]


SETS: dict[str, Maker] = {
    "mcap": _written(".mcap"),
    "mcap ranges": _written(".mcap", "ranges-open"),
    "ros1": _written(".bag"),
    "ros2": _written(".db3"),
    "csv": _written(".csv"),
    "rinex": _written(".obs", "ranges-open"),
    "zip": _packed,
    "gzip": _gzipped,
    **{name: _stream(name) for name in streams.STREAMS},
    "nmea": _stranger(tables.nmea_frozen),
    "phone": _stranger(tables.phone_logger_semicolons),
    "headerless": _stranger(tables.headerless_board),
    "integers": _stranger(tables.receiver_integers),
    "dates": _stranger(tables.american_am_pm),
    "letters": _stranger(tables.hemispheres_as_letters),
    "counter": _stranger(tables.microseconds_that_roll_over),
    "json": _stranger(messages.navsatfix_in_1e7),
    "bag": _stranger(messages.body_twist_in_a_bag),
    "pos": _with_imu("fix.pos", _pos),
    "gpx": _with_imu("fix.gpx", _gpx),
    "tum": _with_imu("reference.tum", _tum),
    "sp3": _sp3,
}
"""The first file of a set is the one to damage, unless chance takes another."""


def make(name: str, folder: Path) -> list[str]:
    """Writes a set into a folder and returns the names of its files."""
    folder.mkdir(parents=True, exist_ok=True)
    return SETS[name](folder)
