"""Formats that can be read, and opening a log by what it holds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from importers.containers.file_bytes import is_bag_folder
from importers.containers.packed import packing_of, unpack_file
from importers.containers.remote import address_of, fetch
from importers.containers.stand_in import Scratch, StandIn, told_as
from importers.drafting.headers import draft_matrices, draft_table
from importers.meanings.mapped_log import MappedLog
from importers.nmea.fixes import read_nmea
from importers.nmea.sentences import is_nmea
from importers.rinex.navigation import is_rinex_navigation, read_rinex_navigation
from importers.rinex.observation import is_rinex_observation, read_rinex_observation
from importers.rinex.sp3 import is_sp3, read_sp3
from importers.rinex.text import other_kind
from importers.rows.clock import leap_seconds
from importers.rows.log import Log
from importers.settings import CsvMapping, InputSettings
from importers.streams import (
    open_dataflash_log,
    open_novatel_stream,
    open_rtcm_stream,
    open_sbf_stream,
    open_ubx_stream,
    open_ulog,
)
from importers.text.csv_layouts import find_layout, read_layout
from importers.text.csv_mapping import find_mappings, read_mapped
from importers.text.csv_ranges import OWN_RANGES
from importers.text.kf_gins import find_kf_gins, read_gnss, read_imu
from importers.text.log import TableLog, TextLog
from importers.text.matrices import is_matlab, read_matrices
from importers.text.rtklib_pos import is_pos, read_pos
from importers.text.smartphone import is_smartphone, read_smartphone
from importers.text.tum import is_tum, read_tum
from importers.text.unix_compress import is_compressed, unpack
from importers.trajectories.gpx import is_gpx, read_gpx
from importers.trajectories.sbet import is_sbet, read_sbet
from navreplay.geodesy.time_scales import LEAP_SECONDS
from navreplay.plugins import load_plugins, told, told_apart
from navreplay.timeline import LogError

__all__ = ["FORMATS", "Format", "known_formats", "open_log"]

_HEAD_BYTES = 20_000
_MOST_PACKINGS = 3


@dataclass(frozen=True, slots=True)
class Format:
    """A readable format: name, a line about it, the usual extensions, and its opener, which returns None when the head (the
    first 20 kB) is not of this format."""

    name: str
    description: str
    extensions: tuple[str, ...]
    open: Callable[[str, bytes, InputSettings], Log | None]


def known_formats() -> tuple[Format, ...]:
    """All formats in the order in which they are tried: those here, and behind them those that other packages register under
    `navreplay.formats`. Raises LogError for a plug-in that cannot be loaded."""
    return (*FORMATS, *_added_formats())


def _added_formats() -> list[Format]:
    names = {known.name for known in FORMATS}
    added = (known for known in load_plugins("navreplay.formats", Format) if isinstance(known, Format))
    return [replace(known, open=_guarded(known)) for known in told_apart("navreplay.formats", added, names)]


def _guarded(added: Format) -> Callable[[str, bytes, InputSettings], Log | None]:
    """The opener of a plug-in, whose failures are its own."""

    def open_added(path: str, head: bytes, settings: InputSettings) -> Log | None:
        """See `Format`."""
        try:
            return added.open(path, head, settings)
        except LogError:
            raise
        except Exception as error:  # whatever a stranger's module raises, the user is told whose it is
            raise LogError(f"{path}: the plug-in of format '{added.name}' fails on it: {told(error)}") from error

    return open_added


def open_log(path: str | Path, settings: InputSettings | None = None) -> Log:
    """Opens a log (a file, or the folder of a ROS 2 bag) by its content. Raises LogError when it is missing, empty or
    unknown."""
    return _open(str(path), settings or InputSettings(), 0)


def _open(name: str, settings: InputSettings, packings: int) -> Log:
    """packings: out of how many it came already."""
    if name == "-":
        raise LogError("-: a log is read more than once, so it cannot come from standard input; save it to a file first")
    address = address_of(name)
    if address is not None:
        owner = Scratch()
        place = fetch(address, owner)
        return _stand_in(address, place, owner, str(place), "", settings, packings)
    head = b"" if Path(name).is_dir() else _read_head(name)
    packing = packing_of(head)
    if packing:
        if packings == _MOST_PACKINGS:
            raise LogError(f"{name}: is packed more than {_MOST_PACKINGS} times over, which no log is; unpack it")
        owner = Scratch()
        plain, note = unpack_file(name, packing, owner)
        named = _with_plain_names(settings, Path(name).name, plain.name)
        return _stand_in(name, plain, owner, name, note, named, packings + 1)
    return _open_plain(name, head, settings)


def _stand_in(path: str, place: Path, owner: Scratch, local: str, note: str, settings: InputSettings, packings: int) -> Log:
    log = told_as(path, str(place), lambda: _open(str(place), settings, packings))
    return StandIn(log, path, str(place), owner, local, note)


def _with_plain_names(settings: InputSettings, packed: str, plain: str) -> InputSettings:
    """The settings, with the mappings of tables that name the packed file naming the plain one."""
    fitting = tuple(mapping.model_copy(update={"match": plain}) for mapping in find_mappings(packed, settings.csv))
    return settings.model_copy(update={"csv": (*fitting, *settings.csv)}) if fitting else settings


def _open_plain(name: str, head: bytes, settings: InputSettings) -> Log:
    for formats in (lambda: FORMATS, _added_formats):  # what is read here needs no plug-in, sound or broken
        for known in formats():
            log = known.open(name, head, settings)
            if log is not None:
                return log
    binary = next((known for known in FORMATS[:3] if Path(name).suffix in known.extensions), None)
    if binary is not None:
        raise LogError(
            f"{name}: does not begin like a {binary.description.split(',')[0].split(' with')[0]}; damaged, or misnamed?"
        )
    kind = other_kind(_text(head))
    if kind:
        raise LogError(
            f"{name}: a RINEX file of {kind}, which is not used; precise clocks come with the orbits of an SP3 file, "
            "ephemerides from a navigation file"
        )
    raise LogError(
        f"{name}: unknown format; by its content it is none of {', '.join(known.name for known in known_formats())}. "
        "A table of numbers needs an [[input.csv]] entry that names its columns"
    )


def _read_head(path: str) -> bytes:
    try:
        with Path(path).open("rb") as file:
            head = file.read(_HEAD_BYTES)
            if is_compressed(head):
                head = unpack(path, head + file.read())[:_HEAD_BYTES]
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror}") from error
    if not head:
        raise LogError(f"{path}: the file is empty; was the recording ever started, or the copy cut short?")
    return head


def _text(head: bytes) -> str:
    encoding = "utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    return head.decode(encoding, errors="replace")


def _open_mcap(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not head.startswith(b"\x89MCAP"):
        return None
    from importers.containers.mcap import McapLog

    return _mapped(McapLog(path), settings)


def _mapped(log: Log, settings: InputSettings) -> Log:
    """A log of messages with the meanings that the settings, or what is known of drivers, give its channels."""
    return MappedLog(log, settings.message, leap_seconds(settings.leap_seconds))


def _open_ros1(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not head.startswith(b"#ROS"):
        return None
    version = head[:20].partition(b"\n")[0].decode(errors="replace").removeprefix("#ROSBAG ").removeprefix("#ROSRECORD ")
    if not version.startswith("V2."):
        raise LogError(
            f"{path}: a ROS bag of the old format {version}; write it anew with ROS 1: rosbag filter {path} new.bag True"
        )
    from importers.containers.ros1_bag import Ros1Bag

    return _mapped(Ros1Bag(path), settings)


def _open_ros2(path: str, head: bytes, settings: InputSettings) -> Log | None:
    folder = Path(path).is_dir()
    if folder and not is_bag_folder(Path(path)):
        raise LogError(f"{path}: the folder holds no ROS 2 bag (no metadata.yaml, no .db3, no .mcap); name the log file itself")
    if not folder and not head.startswith(b"SQLite format 3\x00"):
        return None
    from importers.containers.ros2_bag import Ros2Bag

    return _mapped(Ros2Bag(path), settings)


def _open_mapped(path: str, head: bytes, settings: InputSettings) -> Log | None:
    mappings = find_mappings(path, settings.csv)
    return _table(path, mappings, settings) if mappings else None


def _open_table(path: str, head: bytes, settings: InputSettings) -> Log | None:
    draft = draft_matrices(path) if is_matlab(head) else draft_table(path, head)
    if draft is None and is_matlab(head):
        there = ", ".join(f"{name} {value.shape[0]} x {value.shape[1]}" for name, value in read_matrices(path).items())
        raise LogError(
            f"{path}: a MATLAB file whose matrices ({there or 'none of numbers'}) are not plain by their values; describe one "
            "with an [[input.csv]] that names it with variable, and its columns by their numbers"
        )
    return None if draft is None else _table(path, draft.mappings, settings, draft.lines)


def _table(path: str, mappings: tuple[CsvMapping, ...], settings: InputSettings, drafts: tuple[str, ...] = ()) -> Log:
    leap = leap_seconds(settings.leap_seconds)
    return TableLog(path, {each.role: partial(read_mapped, path, each, settings.gps_week, leap) for each in mappings}, drafts)


def _open_own(path: str, head: bytes, settings: InputSettings) -> Log | None:
    lines = [line for line in _text(head).splitlines() if line.strip() and not line.startswith("#")]
    layout = find_layout(lines[0]) if lines else None
    if layout == "navreplay/range":
        return TextLog(path, "csv", layout, lambda: read_mapped(path, OWN_RANGES, None, LEAP_SECONDS))
    return None if layout is None else TextLog(path, "csv", layout, lambda: read_layout(path, layout))


def _open_smartphone(path: str, head: bytes, settings: InputSettings) -> Log | None:
    return TextLog(path, "smartphone", "smartphone", lambda: read_smartphone(path)) if is_smartphone(_text(head)) else None


def _open_pos(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_pos(_text(head)):
        return None
    return TextLog(path, "pos", "rtklib/pos", lambda: read_pos(path, leap_seconds(settings.leap_seconds)))


def _open_nmea(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_nmea(_text(head)):
        return None
    return TextLog(path, "nmea", "nmea", lambda: read_nmea(path, settings.utc_date, leap_seconds(settings.leap_seconds)))


def _open_kf_gins(path: str, head: bytes, settings: InputSettings) -> Log | None:
    layout = find_kf_gins(path, _text(head))
    if layout is None:
        return None
    read = read_imu if layout == "kf_gins/imu" else read_gnss
    return TextLog(path, "kf-gins", layout, lambda: read(path, settings.gps_week))


def _open_rinex_observation(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_rinex_observation(_text(head)):
        return None
    leap = leap_seconds(settings.leap_seconds)
    return TextLog(path, "rinex", "rinex/observation", lambda: read_rinex_observation(path, settings.range, leap))


def _open_rinex_navigation(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_rinex_navigation(_text(head)):
        return None
    return TextLog(path, "rinex", "rinex/navigation", lambda: read_rinex_navigation(path, leap_seconds(settings.leap_seconds)))


def _open_sp3(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_sp3(_text(head)):
        return None
    return TextLog(path, "sp3", "sp3", lambda: read_sp3(path, leap_seconds(settings.leap_seconds)))


def _open_gpx(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_gpx(_text(head)):
        return None
    return TextLog(path, "gpx", "gpx", lambda: read_gpx(path, leap_seconds(settings.leap_seconds)))


def _open_sbet(path: str, head: bytes, settings: InputSettings) -> Log | None:
    if not is_sbet(head, Path(path).stat().st_size):
        return None
    return TextLog(path, "sbet", "sbet", lambda: read_sbet(path, settings.gps_week))


def _open_tum(path: str, head: bytes, settings: InputSettings) -> Log | None:
    return TextLog(path, "tum", "tum", lambda: read_tum(path)) if is_tum(_text(head)) else None


FORMATS: tuple[Format, ...] = (
    Format("mcap", "MCAP with ROS 2, ROS 1, Foxglove JSON or protobuf messages", (".mcap",), _open_mcap),
    Format("ros1", "ROS 1 bag", (".bag",), _open_ros1),
    Format("ros2", "ROS 2 bag: the folder, or its .db3 file", (".db3",), _open_ros2),
    Format(
        "ubx", "u-blox stream: RXM-RAWX, RXM-SFRBX, NAV-PVT, NAV-HPPOSLLH, ESF-RAW, ESF-MEAS ...", (".ubx",), open_ubx_stream
    ),
    Format(
        "novatel",
        "NovAtel OEM stream, binary or ASCII: RANGE, BESTPOS, BESTVEL, RAWIMUSX, INSPVAX ...",
        (".gps",),
        open_novatel_stream,
    ),
    Format("sbf", "Septentrio SBF: MeasEpoch, PVTGeodetic, ExtSensorMeas, INSNavGeod ...", (".sbf",), open_sbf_stream),
    Format("rtcm", "RTCM 3 stream: MSM4 to MSM7, ephemerides", (".rtcm", ".rtcm3"), open_rtcm_stream),
    Format("ulog", "flight log of PX4 (ULog)", (".ulg",), open_ulog),
    Format("dataflash", "flight log of ArduPilot (DataFlash)", (".bin",), open_dataflash_log),
    Format("csv", "any table of numbers, or matrix of a MATLAB file, by [[input.csv]]", (".csv", ".txt", ".mat"), _open_mapped),
    Format("navreplay", "this program's own CSV: imu, fix, trajectory, solution", (".csv",), _open_own),
    Format("smartphone", "Android raw measurements (device_gnss.csv)", (".csv",), _open_smartphone),
    Format("pos", "RTKLIB position file", (".pos",), _open_pos),
    Format("nmea", "NMEA 0183: GGA, GNS, RMC, ZDA, GST, VTG", (".nmea", ".gga"), _open_nmea),
    Format("kf-gins", "KF-GINS text: IMU increments, GNSS positions", (".txt",), _open_kf_gins),
    Format(
        "rinex",
        "RINEX 2, 3 or 4 observations, also compact (Hatanaka): pseudoranges",
        (".rnx", ".obs", ".crx"),
        _open_rinex_observation,
    ),
    Format("rinex-nav", "RINEX 2, 3 or 4 navigation: ephemerides", (".rnx", ".nav"), _open_rinex_navigation),
    Format("sp3", "SP3 precise orbits and clocks", (".sp3",), _open_sp3),
    Format("gpx", "GPX tracks", (".gpx",), _open_gpx),
    Format("sbet", "SBET trajectory of Applanix POSPac, as a reference", (".out", ".sbet"), _open_sbet),
    Format("tum", "TUM trajectory, as a reference", (".tum", ".txt"), _open_tum),
    Format(
        "table", "any table whose header names what it holds (navreplay init drafts its [[input.csv]])", (".csv",), _open_table
    ),
)
"""In the order in which they are tried."""
