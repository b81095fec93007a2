"""Opening binary streams and flight logs by what they hold; a reader is imported when a file looks like its own."""

import re
from collections.abc import Callable
from pathlib import Path

from importers.rows.clock import leap_seconds
from importers.rows.log import Log
from importers.settings import InputSettings
from importers.ublox.stream import UbxLog, is_ubx

__all__ = ["open_dataflash_log", "open_novatel_stream", "open_rtcm_stream", "open_sbf_stream", "open_ubx_stream", "open_ulog"]

_FAR_BYTES = 4_000_000
"""How far a stream is searched for its first message that is read."""
_UBX = re.compile(rb"\xb5\x62")
_NOVATEL = re.compile(rb"\xaaD[\x12\x13]|[#%][A-Z0-9]+A,")
_SBF = re.compile(rb"\$@")
_RTCM = re.compile(rb"\xd3[\x00-\x03]")
_TEXT_FIRST = (b"$", b"#", b"%", b"<", b"[", b"\r", b"\n")
"""What a stream may begin with before its messages: NMEA, and answers to commands."""


def _beginning(path: str, head: bytes, mark: re.Pattern[bytes]) -> bytes:
    """The first part of a stream that may hold messages with a mark; empty where there is none."""
    if mark.search(head) is None and not head.startswith(_TEXT_FIRST):
        return b""
    with Path(path).open("rb") as file:
        beginning = file.read(_FAR_BYTES)
    return beginning if mark.search(beginning) is not None else b""


def _holds(path: str, head: bytes, mark: re.Pattern[bytes], holds: Callable[[bytes], bool]) -> bool:
    """Whether a stream holds whole messages, in its head or further on."""
    return holds(head) or holds(_beginning(path, head, mark))


def open_ubx_stream(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not _beginning(path, head, _UBX) or not _holds(path, head, _UBX, is_ubx):
        return None
    return UbxLog(path, leap_seconds(settings.leap_seconds), settings.utc_date)


def open_novatel_stream(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not _beginning(path, head, _NOVATEL):
        return None
    from importers.novatel.stream import is_novatel, open_novatel

    return open_novatel(path) if _holds(path, head, _NOVATEL, is_novatel) else None


def open_sbf_stream(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not _beginning(path, head, _SBF):
        return None
    from importers.septentrio.stream import is_sbf, open_sbf

    return open_sbf(path) if _holds(path, head, _SBF, is_sbf) else None


def open_rtcm_stream(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not _beginning(path, head, _RTCM):
        return None
    from importers.receivers.rtcm import is_rtcm, open_rtcm

    return open_rtcm(path, settings.gps_week) if _holds(path, head, _RTCM, is_rtcm) else None


def open_ulog(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not head.startswith(b"ULog\x01\x12\x35"):
        return None
    from importers.autopilots.px4 import open_px4

    return open_px4(path, leap_seconds(settings.leap_seconds))


def open_dataflash_log(path: str, head: bytes, settings: InputSettings) -> Log | None:
    """See `importers.formats.Format.open`."""
    if not head.startswith(b"\xa3\x95\x80"):
        return None
    from importers.autopilots.ardupilot import open_ardupilot

    return open_ardupilot(path)
