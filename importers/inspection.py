"""What logs hold: channels with their rates, gaps and time bases, what each would be used as, and the findings about them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from importers.conversion.ranges import flat_source
from importers.findings import Finding
from importers.formats import open_log
from importers.load import build_timeline, describe_file, open_logs
from importers.meanings.draft import draft_local, draft_mapping
from importers.preflight.checks import preflight
from importers.roles.messages import kind_of, stamp_column
from importers.roles.selection import SETTING, Choice, always_used, candidates, choose_role
from importers.roles.sources import Clock, Source, join_sources
from importers.rows.clock import leap_seconds
from importers.rows.log import Channel, Log, Table
from importers.settings import AttitudeInput, BaroInput, FixInput, ImuInput, InputSettings, ReferenceInput, SpeedInput
from importers.vetting.vet import vet
from navreplay.geodesy.time_scales import LeapSeconds, gps_from_utc
from navreplay.timeline import LogError, SourceFile, Timeline, Times

__all__ = ["ChannelInfo", "Inspection", "draft_mappings", "inspect_logs"]

_GAP_FACTOR = 3.0
_ENCODINGS = ("cdr", "ros1", "json", "protobuf")
_MANY = 1_000_000
_WITHOUT_NAVIGATION = (
    "actionlib_msgs", "can_msgs", "diagnostic_msgs", "map_msgs", "rcl_interfaces", "rosgraph_msgs", "sensor_msgs", "shape_msgs",
    "std_msgs", "stereo_msgs", "tf", "tf2_msgs", "trajectory_msgs", "visualization_msgs",
)  # fmt: skip
_EPOCH_1990_UNIX_NS = 631_152_000 * 10**9


@dataclass(frozen=True, slots=True)
class ChannelInfo:
    """One channel of a file. count: messages. first_ns, last_ns: GPS time of the earliest and latest stamp, None where it
    was not read. rate_hz: by the median interval. gaps: intervals of more than three times the median; largest_gap_s:
    longest interval. time_base: as its stamps look. possible: roles that its type can serve in. role: what it would be used
    as, ``unused`` if nothing."""

    name: str
    file: str
    type: str
    encoding: str
    count: int | None
    first_ns: int | None
    last_ns: int | None
    rate_hz: float | None
    gaps: int
    largest_gap_s: float | None
    time_base: str
    possible: tuple[str, ...]
    role: str


@dataclass(frozen=True, slots=True)
class Inspection:
    """What some logs hold. candidates: by role, the channels among which a setting has to choose, where that is open.
    assumptions: sentences on what was assumed or converted. recognised: what was taken for settings that were not made, by
    their keys."""

    files: tuple[SourceFile, ...]
    channels: tuple[ChannelInfo, ...]
    findings: tuple[Finding, ...]
    candidates: Mapping[str, tuple[str, ...]]
    assumptions: tuple[str, ...]
    recognised: tuple[tuple[str, str], ...]


def inspect_logs(
    paths: Sequence[str | Path], settings: InputSettings | None = None, reference: str | Path | None = None
) -> Inspection:
    """Reads logs and tells what they hold. Raises LogError where a file cannot be opened; all else becomes a finding."""
    settings = settings or InputSettings()
    logs = open_logs(paths, settings)
    reference = settings.reference.file if reference is None else reference
    reference_log = None if reference is None else open_log(reference, settings)
    everything = [*logs, *([] if reference_log is None else [reference_log])]
    findings: list[Finding] = []
    chosen, open_choices = _choose(logs, settings, reference_log, findings)
    tables = _read(everything, findings)
    roles = {(id(choice.log), choice.channel.name): choice.role for choice in chosen}
    channels = tuple(
        _describe(log, channel, tables.get((id(log), channel.name)), roles.get((id(log), channel.name)), settings, findings)
        for log in everything
        for channel in log.channels()
    )
    findings += [Finding("warning", "damaged", f"{log.path}: {note}", "") for log in everything for note in log.notes]
    usable = [choice for choice in chosen if (id(choice.log), choice.channel.name) in tables]
    assumptions: tuple[str, ...] = ()
    recognised: tuple[tuple[str, str], ...] = ()
    try:
        timeline = build_timeline(everything, usable, tables, settings)
    except LogError as error:
        findings.append(Finding("error", "unusable", f"{error}.", ""))
    else:
        assumptions = timeline.provenance.assumptions
        channels = tuple(_as_used(channel, timeline) for channel in channels)
        timeline, vetted = vet(timeline)
        recognised = timeline.provenance.recognised
        findings += [finding for finding in (*vetted, *preflight(timeline)) if finding.code not in _implied(open_choices)]
    files = tuple(describe_file(log) for log in everything)
    return Inspection(files, channels, tuple(findings), open_choices, assumptions, recognised)


def _as_used(channel: ChannelInfo, timeline: Timeline) -> ChannelInfo:
    """The channel, as unused where reading it showed that it is of no use."""
    uses = {use.role for use in timeline.provenance.channels if (use.file, use.name) == (channel.file, channel.name)}
    return replace(channel, role="unused") if channel.role == "velocity" and uses == {"unused"} else channel


def draft_mappings(paths: Sequence[str | Path], settings: InputSettings, inspection: Inspection) -> list[str]:
    """Lines of TOML with a mapping for each channel of an unknown type whose fields suggest one: as comments, unless nothing
    else serves its role. Raises LogError where a file cannot be opened."""
    served = {channel.role for channel in inspection.channels}
    lines: list[str] = []
    for log in open_logs(paths, settings):
        lines += getattr(log, "drafts", ())
        unknown = tuple(channel for channel in log.channels() if _is_unknown(channel))
        tables = log.read(tuple(channel.name for channel in unknown)) if unknown else {}
        drafts = [draft_mapping(channel, tables[channel.name]) for channel in unknown if len(tables[channel.name].log_time_ns)]
        if "fix" not in served:
            drafts += [draft_local(channel) for channel in log.channels()]
        for draft in drafts:
            if draft is not None:
                active = draft.usable and draft.role not in served
                served |= {draft.role} if draft.usable else set()
                lines += ["", *(line if active else f"# {line}" for line in draft.lines)]
    return lines


def _is_unknown(channel: Channel) -> bool:
    """Whether a channel of messages may hold measurements under a type without a meaning known here."""
    package = channel.type.partition("/")[0]
    standard = package in _WITHOUT_NAVIGATION or channel.type.startswith("foxglove.")
    return channel.encoding in _ENCODINGS and kind_of(channel) is None and not standard and (channel.count or 0) <= _MANY


def _implied(open_choices: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """Findings that an open choice has told already."""
    return tuple(code for role, code in (("imu", "no-imu"), ("fix", "no-gnss")) if role in open_choices)


def _choose(
    logs: Sequence[Log], settings: InputSettings, reference: Log | None, findings: list[Finding]
) -> tuple[list[Choice], dict[str, tuple[str, ...]]]:
    chosen: list[Choice] = always_used(logs)
    open_choices: dict[str, tuple[str, ...]] = {}
    for role in SETTING:
        try:
            chosen += choose_role(logs, settings, reference, role)
        except LogError as error:
            searched = logs if role != "reference" or reference is None else [reference]
            open_choices[role] = tuple(dict.fromkeys(choice.channel.name for choice in candidates(searched, role)))
            findings.append(Finding("error", "channel-choice", f"{error}.", f"--set {SETTING[role]}=CHANNEL"))
    return chosen, open_choices


def _read(logs: Sequence[Log], findings: list[Finding]) -> dict[tuple[int, str], Table]:
    """All channels that mean something to navigation."""
    tables: dict[tuple[int, str], Table] = {}
    for log in logs:
        names = tuple(dict.fromkeys(channel.name for channel in log.channels() if kind_of(channel) is not None))
        try:
            read = log.read(names) if names else {}
        except LogError as error:
            findings.append(Finding("error", "unreadable", f"{error}.", ""))
            continue
        tables |= {(id(log), name): table for name, table in read.items()}
        findings += [_unreadable(log, name, table) for name, table in read.items() if table.read and not len(table.log_time_ns)]
    return tables


def _unreadable(log: Log, name: str, table: Table) -> Finding:
    why = ", ".join(f"{count} {reason}" for reason, count in table.rejected.items())
    text = f"{log.path}: none of the {table.read} messages of channel {name} can be read ({why})."
    return Finding("warning", "unreadable", text, "The other channels are read without it.")


def _describe(
    log: Log, channel: Channel, table: Table | None, role: str | None, settings: InputSettings, findings: list[Finding]
) -> ChannelInfo:
    """One channel; a table that cannot be timed becomes a finding."""
    t_ns = np.empty(0, dtype=np.int64)
    base = ""
    if table is not None:
        base = _guess_base(table, leap_seconds(settings.leap_seconds))
        t_ns = _times(log, channel, table, role, settings)
        if (
            base in ("gps time", "tai")
            and "t_gps_ns" not in table.columns
            and role in ("imu", "fix")
            and getattr(settings, role).time_base == "auto"
        ):
            word = "gps" if base == "gps time" else "tai"
            text = f"The stamps of {channel.name} are as far ahead of the recorder's clock as {base} is ahead of UTC."
            hint = f"Set input.{role}.time_base = '{word}' if that is what they are."
            findings.append(Finding("warning", "time-base", text, hint))
    interval = np.diff(t_ns) / 1e9
    nominal = float(np.median(interval)) if len(interval) else None
    return ChannelInfo(
        channel.name,
        log.path,
        channel.type,
        channel.encoding,
        table.read if table is not None else channel.count,
        int(t_ns[0]) if len(t_ns) else None,
        int(t_ns[-1]) if len(t_ns) else None,
        1 / nominal if nominal else None,
        int((interval > _GAP_FACTOR * nominal).sum()) if nominal else 0,
        float(interval.max()) if len(interval) else None,
        base,
        kind.roles if (kind := kind_of(channel)) is not None else (),
        role or "unused",
    )


def _times(log: Log, channel: Channel, table: Table, role: str | None, settings: InputSettings) -> Times:
    by_role: dict[str, ImuInput | FixInput | AttitudeInput | BaroInput | SpeedInput | ReferenceInput]
    by_role = {"imu": settings.imu, "accel": settings.imu, "attitude": settings.attitude, "reference": settings.reference}
    by_role |= {"speed": settings.speed, "baro": settings.baro}
    if role == "time" or len(table.log_time_ns) == 0:
        return np.sort(gps_from_utc(table.log_time_ns, leap_seconds(settings.leap_seconds)))
    source = Source(log.path, channel, table, role or "unused")
    if role == "ephemeris":
        return np.sort(table.columns.get("t_gps_ns", table.log_time_ns))
    if (kind := kind_of(channel)) is not None and "range" in kind.roles:
        return np.unique(flat_source(source).table.log_time_ns)
    return np.sort(
        join_sources([source], by_role.get(role or "", settings.fix), Clock(leap_seconds(settings.leap_seconds))).t_ns
    )


def _guess_base(table: Table, leap: LeapSeconds) -> str:
    """What the stamps look like, beside the clock of the recorder."""
    if "t_gps_ns" in table.columns:
        return "gps time"
    stamps = stamp_column(table)
    if stamps is None or len(stamps) == 0:
        return "recorder's clock"
    if np.median(stamps) < _EPOCH_1990_UNIX_NS:
        return "boot"
    ahead = float(np.median(stamps.astype(np.int64) - table.log_time_ns)) / 1e9
    utc = np.array([np.median(stamps)], dtype=np.int64)
    leaps = float(gps_from_utc(utc, leap)[0] - utc[0]) / 1e9 + 315_964_800
    if abs(ahead - leaps) < 1:
        return "gps time"
    return "tai" if abs(ahead - leaps - 19) < 1 else "utc"
