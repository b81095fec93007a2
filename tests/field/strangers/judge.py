"""A stranger's first steps on a log: inspect, init, run, nothing else; what came of them beside the truth."""

import contextlib
import io
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from navreplay.geodesy.earth import ned_between
from pipelines import cli
from synthetic_logs import SyntheticLog, simulate, truth_at
from tests.field.promise import DRIVES

__all__ = ["Kind", "Steps", "kind", "take_steps"]

_WEEK_NS = 604_800_000_000_000
Writer = Callable[[SyntheticLog, Path], list[str]]


@dataclass(frozen=True, slots=True)
class Kind:
    """write: makes the log's files in a folder and returns their names. drive: of `tests.field.promise`. said: words that the
    three steps must tell between them; refused: whether run must end with one line in place of a solution. alone: rows of the
    fixes' epochs [s from the first] at which no good fix is there. late: of the stamps of the fixes [s], which counts as an
    error of theirs. shift: to be added to the solution's stamps for GPS time [ns]."""

    name: str
    about: str
    write: Writer
    drive: str = "town"
    said: tuple[str, ...] = ()
    refused: bool = False
    alone: tuple[tuple[float, float], ...] = ()
    late: float = 0.0
    shift: int = 0


KINDS: dict[str, Kind] = {}


def kind(
    drive: str = "town",
    said: tuple[str, ...] = (),
    refused: bool = False,
    alone: tuple[tuple[float, float], ...] = (),
    late: float = 0.0,
    shift: int = 0,
) -> Callable[[Writer], Writer]:
    """Registers a function that writes a log; its docstring tells what is odd about it."""

    def register(write: Writer) -> Writer:
        name = write.__name__
        KINDS[name] = Kind(name, (write.__doc__ or "").strip(), write, drive, said, refused, alone, late, shift)
        return write

    return register


@dataclass(frozen=True, slots=True)
class Steps:
    """codes: of inspect, init and run. text: all that they printed. fixes, solution: horizontal RMS errors [m] at the
    solution's epochs between the first and the last fix, NaN without one; error: lines of run that begin with an error."""

    codes: tuple[int, int, int]
    text: str
    fixes: float
    solution: float
    errors: tuple[str, ...]

    @property
    def ratio(self) -> float:
        """Solution over fixes."""
        return self.solution / self.fixes


def take_steps(chosen: Kind, folder: Path, seed: int = 1) -> Steps:
    """Writes the log and takes the steps in its folder."""
    log = simulate(DRIVES[chosen.drive], seed)
    logs = chosen.write(log, folder)
    told = []
    codes = []
    with _inside(folder):
        configured: list[str] = []
        for command in ("inspect", "init", "run"):
            extra = {"inspect": [], "init": ["-o", "first.toml"], "run": ["-o", "out", "--force", *configured]}[command]
            code, text = _call([command, *logs, *extra])
            configured = ["-c", "first.toml"] if command == "init" and code == 0 else configured
            codes.append(code)
            told.append(f"--- {command}: {code}\n{text}")
        fixes, solution = _errors(chosen, log, Path("out")) if codes[2] == 0 else (_fix_error(chosen, log), np.nan)
    errors = tuple(line for line in told[2].splitlines() if line.startswith("navreplay: error"))
    return Steps((codes[0], codes[1], codes[2]), "\n".join(told), fixes, solution, errors)


def _call(arguments: list[str]) -> tuple[int, str]:
    printed = io.StringIO()
    with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(printed):
        code = cli.main(arguments)
    return code, printed.getvalue()


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _horizontal(log: SyntheticLog, t_ns: np.ndarray, lla: np.ndarray) -> np.ndarray:
    return np.hypot(*ned_between(truth_at(log.scenario.journey, t_ns).lla, lla)[:, :2].T)


def _with_fixes(chosen: Kind, log: SyntheticLog, t_ns: np.ndarray) -> np.ndarray:
    assert log.fixes is not None
    at = (t_ns - log.fixes.t_ns[0]) / 1e9
    inside = (t_ns >= log.fixes.t_ns[0]) & (t_ns <= min(log.fixes.t_ns[-1], log.truth.t_ns[-1]))
    return inside & ~np.any([(at >= first) & (at <= last + 20) for first, last in chosen.alone] or [at < -1], axis=0)


def _fix_error(chosen: Kind, log: SyntheticLog) -> float:
    assert log.fixes is not None
    good = _with_fixes(chosen, log, log.fixes.t_ns)
    stamps = np.minimum(log.fixes.t_ns + round(chosen.late * 1e9), log.truth.t_ns[-1])[good]
    return float(np.sqrt(np.mean(_horizontal(log, stamps, log.fixes.lla[good]) ** 2)))


def _errors(chosen: Kind, log: SyntheticLog, out: Path) -> tuple[float, float]:
    rows = pd.read_csv(out / "solution.csv")
    t_ns = rows["gps_week"].to_numpy(np.int64) * _WEEK_NS + np.rint(rows["gps_tow_s"].to_numpy() * 1e9).astype(np.int64)
    t_ns, once = np.unique(t_ns + chosen.shift, return_index=True)
    lla = np.column_stack([np.radians(rows["lat_deg"]), np.radians(rows["lon_deg"]), rows["height_m"]])[once]
    good = _with_fixes(chosen, log, t_ns)
    if not good.any():
        return _fix_error(chosen, log), np.inf
    return _fix_error(chosen, log), float(np.sqrt(np.mean(_horizontal(log, t_ns[good], lla[good]) ** 2)))
