"""Loading logs into one timeline."""

from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np

from importers.conversion.attitudes import convert_attitude
from importers.conversion.barometers import convert_baro
from importers.conversion.fixes import convert_fixes
from importers.conversion.imu import convert_imu
from importers.conversion.imu_pair import join_accelerations
from importers.conversion.ranges import convert_ranges
from importers.conversion.reference import convert_reference, reference_from_fixes
from importers.conversion.speeds import convert_speed
from importers.formats import open_log
from importers.meanings.mapped_log import unused_mappings
from importers.roles.selection import Choice, choose_channels, named_channel
from importers.roles.sources import Clock, Joined, Source, join_sources
from importers.rows.clock import leap_seconds
from importers.rows.log import Log, Table, local_path
from importers.settings import InputSettings
from importers.text.csv_mapping import unused_tables
from navreplay.timeline import ChannelUse, LogError, Provenance, RangeSeries, SourceFile, Timeline, Trajectory

__all__ = ["build_timeline", "describe_file", "load_timeline", "open_logs"]

Progress = Callable[[float], None]
_BLOCK = 1 << 20


def load_timeline(
    paths: Sequence[str | Path],
    settings: InputSettings | None = None,
    reference: str | Path | None = None,
    progress: Progress | None = None,
) -> Timeline:
    """Reads logs, and a reference beside them, into one timeline; progress is called with the fraction done.

    A series no channel serves is None: `importers.preflight.checks` tells what that means. Raises LogError where a file cannot
    be read, a channel is missing or ambiguous, or a chosen channel holds nothing usable.
    """
    settings = settings or InputSettings()
    logs = open_logs(paths, settings)
    reference = settings.reference.file if reference is None else reference
    reference_log = None if reference is None else open_log(reference, settings)
    choices = choose_channels(logs, settings, reference_log)
    everything = [*logs, *([] if reference_log is None else [reference_log])]
    if not choices:
        types = (
            ", ".join(f"{channel.name} ({channel.type})" for log in logs for channel in log.channels()) or "no channel at all"
        )
        raise LogError(f"{_names(logs)}: no channel can serve navigation; there is {types}")
    return build_timeline(everything, choices, _read_tables(everything, choices, progress), settings)


def open_logs(paths: Sequence[str | Path], settings: InputSettings) -> list[Log]:
    """The logs, each file once, and the navigation files that the settings name. Raises LogError."""
    if not paths:
        raise LogError("no log was named")
    return [open_log(path, settings) for path in dict.fromkeys(str(path) for path in (*paths, *settings.range.navigation))]


def build_timeline(
    logs: Sequence[Log], choices: Sequence[Choice], tables: dict[tuple[int, str], Table], settings: InputSettings
) -> Timeline:
    """The timeline of channels already read: tables by the log's identity and the channel's name. Raises LogError."""
    sources, unreadable = _readable_sources(choices, tables, settings)
    clock = Clock(leap_seconds(settings.leap_seconds), tuple(source.table for source in sources.get("time", [])))
    uses: list[ChannelUse] = [_time_use(source) for source in sources.get("time", [])]
    notes: list[str] = []
    recognised: dict[str, str] = {}
    imu = fixes = ranges = attitude = trajectory = speed = baro = None
    if "imu" in sources:
        joined = join_sources(sources["imu"], settings.imu, clock)
        if "accel" in sources:
            forces = join_sources(sources["accel"], settings.imu, clock)
            joined, told = join_accelerations(joined, forces, settings.imu.accel_channel is not None)
            uses += told
        imu, told, assumed, found = convert_imu(joined, settings.imu)
        uses, notes, recognised = [*uses, *told], [*notes, *assumed], recognised | found
    if "fix" in sources or "velocity" in sources:
        position, velocity = _positions_and_velocities(sources, settings, clock, unreadable)
        fixes, told, assumed, found = convert_fixes(position, velocity, settings.fix)
        uses, notes, recognised = [*uses, *told], [*notes, *assumed], recognised | found
    if "range" in sources:
        ranges, told, assumed = _ranges(sources, settings, clock)
        uses, notes = [*uses, *told], [*notes, *assumed]
    if "attitude" in sources:
        attitude, told, assumed = convert_attitude(
            join_sources(sources["attitude"], settings.attitude, clock), settings.attitude
        )
        uses, notes = [*uses, *told], [*notes, *assumed]
    if "speed" in sources:
        speed, told, assumed = convert_speed(join_sources(sources["speed"], settings.speed, clock), settings.speed)
        uses, notes = [*uses, *told], [*notes, *assumed]
    if "baro" in sources:
        baro, told, assumed = convert_baro(join_sources(sources["baro"], settings.baro, clock))
        uses, notes = [*uses, *told], [*notes, *assumed]
    if "reference" in sources:
        trajectory, told, assumed = _reference(sources["reference"], settings, clock, unreadable)
        uses, notes = [*uses, *told], [*notes, *assumed]
    elif settings.reference.from_fixes and fixes is not None:
        trajectory = reference_from_fixes(fixes, settings.reference)
        notes.append("the fixes themselves, before any is withheld, serve as the reference: not an independent one")
    files = tuple(describe_file(log) for log in {log.path: log for log in logs}.values())
    damage = (*(f"{log.path}: {note}" for log in logs for note in log.notes), *unreadable)
    damage += (
        *unused_mappings(logs, settings.message),
        *unused_tables([log.path for log in logs], settings.csv),
    )
    provenance = Provenance(files, _complete(logs, uses), tuple(dict.fromkeys(notes)), damage, tuple(recognised.items()))
    return Timeline(
        imu=imu,
        fixes=fixes,
        ranges=ranges,
        attitude=attitude,
        reference=trajectory,
        speed=speed,
        baro=baro,
        fix_lever_b=np.array(settings.fix.lever_arm_m),
        reference_lever_b=_reference_lever(settings),
        provenance=provenance,
    )


def _positions_and_velocities(
    sources: Mapping[str, list[Source]], settings: InputSettings, clock: Clock, told: list[str]
) -> tuple[Joined | None, Joined | None]:
    """Both channels of a receiver; velocities that no setting names and that cannot be read cost the positions nothing."""
    position = join_sources(sources["fix"], settings.fix, clock) if "fix" in sources else None
    try:
        velocity = join_sources(sources["velocity"], settings.fix, clock) if "velocity" in sources else None
    except LogError as error:
        if position is None or settings.fix.velocity_channel is not None:
            raise
        told.append(f"{error}; so its velocities are not used")
        velocity = None
    return position, velocity


def _reference(
    sources: list[Source], settings: InputSettings, clock: Clock, told: list[str]
) -> tuple[Trajectory | None, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The reference, its accounting, and what was assumed; none where a driver's own solution, which nobody asked for, is of no
    use."""
    try:
        return convert_reference(join_sources(sources, settings.reference, clock), settings.reference)
    except LogError as error:
        if settings.reference.channel is not None or any(source.channel.rank == 0 for source in sources):
            raise
        told.append(f"{error}; so there is no reference")
        return None, (), ()


_INDISPENSABLE = ("imu", "fix")


def _readable_sources(
    choices: Sequence[Choice], tables: dict[tuple[int, str], Table], settings: InputSettings
) -> tuple[dict[str, list[Source]], list[str]]:
    """Sources by role, and sentences on channels left out: of a role that no setting names and that a drive can do without,
    one whose messages cannot be read costs nothing but itself."""
    sources: dict[str, list[Source]] = {}
    told = []
    for choice in choices:
        table, channel = tables[id(choice.log), choice.channel.name], choice.channel
        lost = table.read > 0 and len(table.log_time_ns) == 0
        if lost and choice.role not in _INDISPENSABLE and named_channel(settings, choice.role) is None:
            why = ", ".join(table.rejected)
            told.append(
                f"{choice.log.path}: channel {channel.name} is not used: none of its {table.read} messages is readable: {why}"
            )
        else:
            sources.setdefault(choice.role, []).append(Source(choice.log.path, channel, table, choice.role))
    return sources, told


def _ranges(
    sources: Mapping[str, list[Source]], settings: InputSettings, clock: Clock
) -> tuple[RangeSeries | None, Sequence[ChannelUse], Sequence[str]]:
    """Raw ranges; None, and why, where they are of no use but were not asked for and there are fixes."""
    try:
        return convert_ranges(sources["range"], sources.get("ephemeris", []), settings.range, clock.leap)
    except LogError as error:
        if "fix" not in sources or settings.range.channel is not None:
            raise
        return None, (), (f"{error}; so its ranges are not used",)


def describe_file(log: Log) -> SourceFile:
    """Size and SHA-256 of a log; of a folder, over its files in the order of their names."""
    root = local_path(log)
    files = sorted(part for part in root.rglob("*") if part.is_file()) if root.is_dir() else [root]
    digest, size = sha256(), 0
    for part in files:
        with part.open("rb") as file:
            while block := file.read(_BLOCK):
                digest.update(block)
                size += len(block)
    return SourceFile(log.path, log.format, size, digest.hexdigest())


def _read_tables(logs: Sequence[Log], choices: Sequence[Choice], progress: Progress | None) -> dict[tuple[int, str], Table]:
    sizes = [local_path(log).stat().st_size for log in logs]
    tables: dict[tuple[int, str], Table] = {}
    done = 0
    for log, size in zip(logs, sizes, strict=True):
        names = tuple(dict.fromkeys(choice.channel.name for choice in choices if choice.log is log))
        if names:
            tables |= {(id(log), name): table for name, table in log.read(names).items()}
        done += size
        if progress is not None:
            progress(done / max(sum(sizes), 1))
    return tables


def _time_use(source: Source) -> ChannelUse:
    rejected = dict(source.table.rejected)
    read = source.table.read
    return ChannelUse(
        source.channel.name, source.file, source.channel.type, "time", read, read - sum(rejected.values()), rejected
    )


def _complete(logs: Sequence[Log], uses: Sequence[ChannelUse]) -> tuple[ChannelUse, ...]:
    """The accounting in the order of the files, with the channels that serve nothing."""
    complete: list[ChannelUse] = []
    for path, log in {log.path: log for log in logs}.items():
        for channel in log.channels():
            own = [use for use in uses if use.file == path and use.name == channel.name]
            complete += own or [ChannelUse(channel.name, path, channel.type, "unused", 0, 0)]
    return tuple(complete)


def _reference_lever(settings: InputSettings) -> np.ndarray:
    """Fixes that serve as the reference describe the antenna."""
    return np.array(settings.fix.lever_arm_m if settings.reference.from_fixes else settings.reference.lever_arm_m)


def _names(logs: Sequence[Log]) -> str:
    return ", ".join(log.path for log in logs)
