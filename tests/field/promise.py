"""The promise, judged from outside: a log with a fault through the command line, its solution beside the fixes it was given."""

import contextlib
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from navreplay.geodesy.earth import ned_between
from navreplay.timeline import FixStatus
from pipelines import cli
from synthetic_logs import SCENARIOS, GnssErrors, Scenario, SyntheticLog, simulate, truth_at, with_duration, write
from synthetic_logs.faults import FAULTS, Spoilt

__all__ = ["DRIVES", "Outcome", "judge", "spoil"]

MOST = 1.2
"""The solution's horizontal error may be this many times that of the fixes."""

_WEEK_NS = 604_800_000_000_000
_SINGLE = GnssErrors((1.5, 1.5, 2.5), (0.08, 0.08, 0.12))
_FIXED = GnssErrors((0.015, 0.015, 0.03), (0.03, 0.03, 0.05), status=FixStatus.FIXED)


def _drive(name: str, scenario: str, gnss: GnssErrors, rate: float, duration: float) -> Scenario:
    base = with_duration(SCENARIOS[scenario], duration)
    journey = replace(base.journey, gnss_rate=rate, lever_b=(0.0, 0.0, 0.0))
    return replace(base, name=name, journey=journey, gnss=gnss)


DRIVES: dict[str, Scenario] = {
    scenario.name: scenario
    for scenario in (
        _drive("town", "car-short", _SINGLE, 1.0, 120.0),
        _drive("town-rtk", "car-short", _FIXED, 5.0, 120.0),
        _drive("town-positions", "car-short", replace(_SINGLE, velocity_std=None), 5.0, 120.0),
        _drive("flight", "uav-flight", _SINGLE, 1.0, 180.0),
    )
}
"""Drives that faults are done to; none has a lever arm, which nobody told."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """code: exit code. fixes, solution: horizontal RMS errors [m] at the fixes' epochs, outside the fault's windows; NaN where
    there is no solution. peak: largest horizontal error of all. said: lines on standard error, and verdict."""

    drive: str
    fault: str
    code: int
    fixes: float
    solution: float
    peak: float
    said: str

    @property
    def ratio(self) -> float:
        """Solution over fixes."""
        return self.solution / self.fixes

    @property
    def kept(self) -> bool:
        """Whether the promise was kept: no worse than the fixes, or refused in one line."""
        refused = self.code == 1 and self.said.count("\n") == 0 and "Traceback" not in self.said
        return refused or (self.code == 0 and self.ratio <= MOST)


def spoil(drive: str, fault: str | None, seed: int = 1) -> Spoilt:
    """The drive with the fault, or as it is."""
    log = simulate(DRIVES[drive], seed)
    return Spoilt(log) if fault is None else FAULTS[fault].spoil(log)


def judge(drive: str, fault: str | None, folder: Path, seed: int = 1, options: tuple[str, ...] = ()) -> Outcome:
    """Writes the log, runs it as a stranger would, and compares."""
    spoilt = spoil(drive, fault, seed)
    write(spoilt.log, folder / "log.csv", force=True)
    logs = [str(path) for path in sorted(folder.glob("log.*.csv")) if "truth" not in path.name]
    told, printed = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(printed):
        code = cli.main(["run", *logs, "-o", str(folder / "out"), "--force", *options])
    errors = [line for line in told.getvalue().splitlines() if line.startswith("navreplay: error")]
    fixes, solution, peak = _errors(spoilt, folder / "out") if code == 0 else (_fix_error(spoilt), np.nan, np.nan)
    return Outcome(drive, fault or "none", code, fixes, solution, peak, "\n".join(errors))


def _true_positions(log: SyntheticLog, t_ns: np.ndarray) -> np.ndarray:
    return truth_at(log.scenario.journey, t_ns).lla


def _within(log: SyntheticLog, t_ns: np.ndarray) -> np.ndarray:
    """(n,) whether there is a truth at times."""
    return (t_ns >= log.truth.t_ns[0]) & (t_ns <= log.truth.t_ns[-1])


def _horizontal(truth: np.ndarray, lla: np.ndarray) -> np.ndarray:
    return np.hypot(*ned_between(truth, lla)[:, :2].T)


def _fix_error(spoilt: Spoilt) -> float:
    fixes = spoilt.log.fixes
    assert fixes is not None
    good = _within(spoilt.log, fixes.t_ns) & ~spoilt.alone(fixes.t_ns, 0.0)
    error = _horizontal(_true_positions(spoilt.log, fixes.t_ns[good]), fixes.lla[good])
    return float(np.sqrt(np.mean(error**2)))


def _errors(spoilt: Spoilt, out: Path) -> tuple[float, float, float]:
    rows = pd.read_csv(out / "solution.csv")
    t_ns = rows["gps_week"].to_numpy(np.int64) * _WEEK_NS + np.rint(rows["gps_tow_s"].to_numpy() * 1e9).astype(np.int64)
    lla = np.column_stack([np.radians(rows["lat_deg"]), np.radians(rows["lon_deg"]), rows["height_m"]])
    known = _within(spoilt.log, t_ns)
    t_ns, lla = t_ns[known], lla[known]
    error = _horizontal(_true_positions(spoilt.log, t_ns), lla)
    fixes = spoilt.log.fixes
    assert fixes is not None
    inside = (t_ns >= fixes.t_ns[0]) & (t_ns <= fixes.t_ns[-1]) & ~spoilt.alone(t_ns)
    return _fix_error(spoilt), float(np.sqrt(np.mean(error[inside] ** 2))), float(error.max())
