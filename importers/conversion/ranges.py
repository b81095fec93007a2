"""Raw pseudoranges as a series: one signal per satellite and epoch, corrected for the satellite, with its state."""

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from importers.conversion.ephemeris_sources import read_ephemerides
from importers.roles.range_messages import range_table
from importers.roles.sources import Joined, Source, account
from importers.rows.ranges import Applied, RangeRows, join_range_rows, range_rows
from importers.rows.screening import Screening
from importers.rows.signals import SPEED_OF_LIGHT, rank_signals
from importers.rows.tables import Rows
from importers.satellites.ephemeris import Ephemerides
from importers.satellites.flight_rotation import turn_to_reception
from importers.satellites.states import FAULTS, satellite_states
from importers.settings import RangeInput
from navreplay.geodesy.time_scales import LeapSeconds
from navreplay.timeline import ChannelUse, Floats, LogError, RangeSeries

__all__ = ["convert_ranges", "flat_source"]

_EARLIEST_NS = 315_000_000 * 10**9
_LEAST_M, _LARGEST_M = 1e6, 1e8
_FASTEST_MPS = 1e5
_ENOUGH_EPOCHS = 3
_FREE = Applied.IONOSPHERE | Applied.TROPOSPHERE


def flat_source(source: Source) -> Source:
    """A source with a row per observation. Raises LogError where the fields of its type are missing."""
    try:
        return replace(source, table=range_table(source.channel.type, source.table))
    except KeyError as error:
        raise LogError(
            f"{source.file}: channel {source.channel.name} says it is {source.channel.type} but has no field {error.args[0]}"
        ) from error


def convert_ranges(
    sources: Sequence[Source], ephemeris_sources: Sequence[Source], settings: RangeInput, leap: LeapSeconds
) -> tuple[RangeSeries, tuple[ChannelUse, ...], tuple[str, ...]]:
    """The series, its accounting, and what was assumed. Raises LogError where no pseudorange is usable."""
    flat = [flat_source(source) for source in sources]
    rows = join_range_rows([range_rows(source.table.columns) for source in flat])
    name, n = flat[0].channel.name, len(rows.t_ns)
    ends = np.cumsum([len(source.table.log_time_ns) for source in flat])
    parts = tuple(slice(int(end) - len(source.table.log_time_ns), int(end)) for end, source in zip(ends, flat, strict=True))
    near_ns = int(np.median(rows.t_ns)) if n else 0
    ephemerides, uses = read_ephemerides(ephemeris_sources, near_ns, leap)
    joined = Joined(name, rows.t_ns, Rows(), tuple(flat), parts, ())
    notes: list[str] = []
    if settings.time_offset_s:
        rows = replace(rows, t_ns=rows.t_ns + round(settings.time_offset_s * 1e9))
        notes.append(f"{name}: {settings.time_offset_s:g} s were added to its stamps")
    screening = Screening(name, n)
    _screen(screening, rows, settings)
    rows, told = _apply_ephemerides(screening, rows, ephemerides)
    notes += told
    kept = np.flatnonzero(screening.kept)
    if len(kept) == 0:
        raise LogError(f"{name}: none of its {n} pseudoranges is usable: {_count(screening)}; {_cause(screening, ephemerides)}")
    order = kept[np.lexsort((rows.sat[kept], rows.t_ns[kept]))]
    chosen = RangeRows(**{field.name: getattr(rows, field.name)[order] for field in fields(RangeRows)})
    series, told = _build(name, chosen)
    series, model = _with_ionosphere(name, series, flat, ephemerides)
    return series, (*account(joined, screening), *uses), (*notes, *told, *model)


def _screen(screening: Screening, rows: RangeRows, settings: RangeInput) -> None:
    """Rejects what cannot be used, and all but one signal of a satellite."""
    rank = rank_signals(rows.sat, rows.signal, settings.signals)
    screening.reject(rows.t_ns < _EARLIEST_NS, "stamp before 1990")
    screening.reject(rows.sat == "", "no such satellite")
    screening.reject(~np.isin(rows.sat.astype("U1"), list(settings.systems)), "system not in input.range.systems")
    screening.reject(rank < 0, "signal not in input.range.signals")
    screening.reject(~np.isfinite(rows.pseudorange), "no pseudorange")
    screening.reject((rows.pseudorange < _LEAST_M) | (rows.pseudorange > _LARGEST_M), "absurd pseudorange")
    screening.reject(rows.cn0 < settings.min_cn0_dbhz, "C/N0 below min_cn0_dbhz")
    kept = np.flatnonzero(screening.kept)
    order = kept[np.lexsort((rank[kept], rows.sat[kept], rows.t_ns[kept]))]
    again = (np.diff(rows.t_ns[order]) == 0) & (rows.sat[order][1:] == rows.sat[order][:-1])
    twice = again & (rows.signal[order][1:] == rows.signal[order][:-1])
    for which, reason in ((twice, "satellite twice in an epoch"), (again & ~twice, "another signal of the satellite is used")):
        bad = np.zeros(len(rows.t_ns), dtype=bool)
        bad[order[1:][which]] = True
        screening.reject(bad, reason)


def _apply_ephemerides(screening: Screening, rows: RangeRows, ephemerides: Ephemerides) -> tuple[RangeRows, tuple[str, ...]]:
    """Rows whose satellite has a state and whose pseudorange holds the satellite's clock, relativity and group delay; those
    that have them already keep theirs."""
    stated = np.isfinite(rows.sat_pos_e).all(axis=1) & np.isfinite(rows.sat_vel_e).all(axis=1)
    stated &= (rows.applied & Applied.SATELLITE_CLOCK) != 0
    corrected = (rows.applied & Applied.SATELLITE_CLOCK) != 0
    screening.reject(corrected & ~stated, "corrected, but without a satellite state")
    raw = np.flatnonzero(screening.kept & ~stated)
    pos, vel, applied = rows.sat_pos_e.copy(), rows.sat_vel_e.copy(), rows.applied.copy()
    pseudorange, range_rate = rows.pseudorange.copy(), rows.range_rate.copy()
    without = screening.kept & stated & ((rows.applied & Applied.RELATIVITY) == 0)
    pseudorange[without] -= 2 * np.einsum("nx,nx->n", pos[without], vel[without]) / SPEED_OF_LIGHT
    notes = []
    if (screening.kept & stated & ((rows.applied & Applied.GROUP_DELAY) == 0)).any():
        notes.append(f"{screening.name}: the group delays of its satellites are not corrected (up to a few metres)")
    if len(raw):
        states = satellite_states(ephemerides, rows.sat[raw], rows.signal[raw], rows.t_ns[raw], rows.pseudorange[raw])
        for code, reason in enumerate(FAULTS[1:], 1):
            bad = np.zeros(len(rows.t_ns), dtype=bool)
            bad[raw[states.fault == code]] = True
            screening.reject(bad, reason)
        pos[raw], vel[raw] = states.pos, states.vel
        pseudorange[raw] += SPEED_OF_LIGHT * states.clock
        range_rate[raw] += SPEED_OF_LIGHT * states.drift
        applied[raw] &= ~np.int64(Applied.TURNED | Applied.TURNED_BY_PSEUDORANGE)
        notes.append(f"{screening.name}: satellite positions and clocks are computed from ephemerides")
    changed = replace(rows, sat_pos_e=pos, sat_vel_e=vel, applied=applied, pseudorange=pseudorange, range_rate=range_rate)
    return changed, tuple(notes)


def _build(name: str, rows: RangeRows) -> tuple[RangeSeries, tuple[str, ...]]:
    """The series of rows in the order of time, with satellites turned to the time of reception."""
    free = rows.applied & _FREE
    if (free != free[0]).any():
        raise LogError(
            f"{name}: some of its pseudoranges are free of ionosphere or troposphere and some are not; leave one out"
        )
    notes: list[str] = []
    pos, vel = rows.sat_pos_e.copy(), rows.sat_vel_e.copy()
    turn = np.flatnonzero((rows.applied & Applied.TURNED) == 0)
    if len(turn):
        by_pseudorange = (rows.applied[turn] & Applied.TURNED_BY_PSEUDORANGE) != 0
        turned_s = np.where(by_pseudorange, rows.pseudorange[turn] / SPEED_OF_LIGHT, 0.0)
        pos[turn], vel[turn], tried, met = turn_to_reception(
            rows.t_ns[turn], rows.sat[turn], rows.pseudorange[turn], pos[turn], vel[turn], turned_s
        )
        if met == 0 and tried >= _ENOUGH_EPOCHS:
            raise LogError(
                f"{name}: its pseudoranges meet nowhere, in none of {tried} epochs within a kilometre; are its stamps in "
                "another time scale than said (leap seconds: set input.range.time_offset_s), or the ephemerides of another day?"
            )
        if met == 0:
            notes.append(
                f"{name}: no epoch has satellites enough to tell the receiver's clock, which is taken as right for flight times"
            )
    rate = np.where(np.abs(rows.range_rate) < _FASTEST_MPS, rows.range_rate, np.nan)
    series = RangeSeries(
        t_ns=rows.t_ns,
        sat=rows.sat,
        signal=rows.signal,
        pseudorange=rows.pseudorange,
        range_rate=rate,
        pseudorange_std=_positive(rows.pseudorange_std),
        range_rate_std=_positive(rows.range_rate_std),
        cn0=_positive(rows.cn0),
        sat_pos_e=pos,
        sat_vel_e=vel,
        ionosphere_removed=bool(free[0] & Applied.IONOSPHERE),
        troposphere_removed=bool(free[0] & Applied.TROPOSPHERE),
    )
    return series, tuple(notes)


def _positive(values: Floats) -> Floats:
    """Zero and less mean unknown."""
    return np.where((values > 0) & np.isfinite(values), values, np.nan)


def _with_ionosphere(
    name: str, series: RangeSeries, sources: Sequence[Source], ephemerides: Ephemerides
) -> tuple[RangeSeries, tuple[str, ...]]:
    """The series with the coefficients of the ionosphere's broadcast model, from the observations' own messages, else from the
    navigation data, and what that assumes."""
    tables = [source.table.columns for source in sources]
    own = np.concatenate([np.empty((0, 8)), *(columns["klobuchar"] for columns in tables if "klobuchar" in columns)])
    own = own[np.isfinite(own).all(axis=1)]
    coefficients, system = (own[-1], "G") if len(own) else (ephemerides.klobuchar, ephemerides.klobuchar_system)
    if series.ionosphere_removed:
        notes: tuple[str, ...] = ()
    elif coefficients is None:
        notes = (f"{name}: the log has no coefficients of an ionosphere model: that delay (metres by day) is not corrected",)
    elif system == "C":
        notes = (f"{name}: the ionosphere's delay is told by BeiDou's broadcast model, as the log has no coefficients of GPS",)
    else:
        notes = (f"{name}: the ionosphere's delay is told by GPS's broadcast model",)
    return replace(series, klobuchar=coefficients, klobuchar_system=system), notes


def _count(screening: Screening) -> str:
    counts = screening.rejected(slice(None))
    return ", ".join(f"{reason} {count}" for reason, count in counts.items())


def _cause(screening: Screening, ephemerides: Ephemerides) -> str:
    counts = screening.rejected(slice(None))
    worst = max(counts, key=lambda reason: counts[reason], default="")
    if FAULTS[1] in counts and not ephemerides:
        return "add the navigation file (RINEX navigation or SP3) to the logs, or name it with input.range.navigation"
    return {
        FAULTS[1]: "is the navigation file of the same day and the same systems?",
        FAULTS[2]: "is the navigation file of another day, or the GPS week of the observations wrong?",
        "absurd pseudorange": "do its header or mapping name the right column?",
        "signal not in input.range.signals": "set input.range.signals to those it has",
        "corrected, but without a satellite state": "add the positions and velocities of the satellites",
    }.get(worst, "is this the right channel?")
