"""Damaged logs of every format through inspect and run: python -m tests.field.mutate --count N --seed S [--seconds T] [WORD
...]

Each must end with exit code 0, or with 1 and one line: no traceback, no warning of Python, no crash, no hang, no memory without
bounds. What does not is printed with the number that makes it again (--seed S --first NUMBER --count 1). Cases run in child
processes, so that a crash ends one of these only.
"""

import argparse
import contextlib
import importlib
import io
import os
import pkgutil
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from types import FrameType

import numpy as np

import importers
import navreplay
import pipelines
from pipelines import cli
from tests.field.sound_files import SETS, make

__all__ = ["damaged", "faults_of", "main"]

_PER_CHILD = 200
_LONGEST_S = 60
_MOST_BYTES = 3 * 2**30
_NUMBERS = (b"1e300", b"-1e19", b"nan", b"inf", b"-1", b"0", b"99999999999999999999", b"1.5e-320", b"", b"x", b"\xff\xfe")
_WORDS = (0, 1, 2**7, 2**8 - 1, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One to four kinds of damage, one after the other."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        at, length = int(rng.integers(len(data))), int(rng.integers(1, 300))
        kind = int(rng.integers(8))
        if kind == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at : at + length] = rng.bytes(len(data[at : at + length]))
        elif kind == 2:
            del data[at:]
        elif kind == 3:
            del data[at : at + length]
        elif kind == 4:
            data[at:at] = data[at : at + length]
        elif kind == 5:
            size = int(rng.choice([1, 2, 4, 8]))
            word = _WORDS[int(rng.integers(len(_WORDS)))] % 2 ** (8 * size)
            data[at : at + size] = word.to_bytes(size, "little" if rng.random() < 0.8 else "big")
        elif kind == 6:
            _change_number(data, at, rng)
        else:
            to = int(rng.integers(len(data)))
            data[to : to + length] = data[at : at + length]
    return bytes(data)


def _change_number(data: bytearray, at: int, rng: np.random.Generator) -> None:
    """In place of the cell about a place, another number, or none."""
    marks = b",; \t\n"
    begin = max((data.rfind(mark, 0, at) for mark in marks), default=-1) + 1
    end = min((place for mark in marks if (place := data.find(mark, at)) >= 0), default=len(data))
    if end - begin < 64:
        data[begin:end] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]


class _Hang(BaseException):
    """A case took too long; no handler of errors may catch it."""


def _ring(number: int, frame: FrameType | None) -> None:
    raise _Hang(f"no end within {_LONGEST_S} s")


def faults_of(command: list[str]) -> str:
    """What is wrong with the way a command of the program ends; empty where nothing is."""
    told, printed = io.StringIO(), io.StringIO()
    signal.signal(signal.SIGALRM, _ring)
    signal.alarm(_LONGEST_S)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stderr(told), contextlib.redirect_stdout(printed):
            warnings.simplefilter("error")
            code = cli.main(command)
    except (Exception, _Hang, SystemExit) as error:
        return f"{type(error).__name__}: {error}\n{''.join(traceback.format_tb(error.__traceback__)[-4:])}"
    finally:
        signal.alarm(0)
    errors = [line for line in told.getvalue().splitlines() if line.startswith("navreplay: error")]
    if code not in (0, 1) or (code == 1) != (len(errors) == 1) or "Traceback" in told.getvalue() + printed.getvalue():
        return f"exit {code}, {len(errors)} lines of error: {told.getvalue()[-500:]}"
    if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 > _MOST_BYTES:
        return f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.1f} GB of memory"
    return ""


def _try_case(seed: int, number: int, names: list[str], sound: Path, scratch: Path) -> str:
    """One damaged set through both commands."""
    rng = np.random.default_rng([seed, number])
    name = names[number % len(names)]
    files = sorted((sound / name).iterdir())
    order = (sound / f"{name}.order").read_text().split("\n")
    victim = order[0] if rng.random() < 0.8 else order[int(rng.integers(len(order)))]
    for path in files:
        if path.name in order:
            content = path.read_bytes()
            (scratch / path.name).write_bytes(damaged(content, rng) if path.name == victim else content)
    logs = [str(scratch / file) for file in order]
    out = scratch / "out"
    quick = ["--quick", "--set", "output.recording=false"]
    for command in (["inspect", *logs], ["run", *logs, "-o", str(out), "--force", *quick]):
        fault = faults_of(command)
        if fault:
            return f"case {number} ({name}, {victim} damaged), {command[0]}: {fault}"
    return ""


def _try_batch(seed: int, numbers: range, names: list[str], sound: Path, progress: Path) -> int:
    """Cases in a child; how many of them were tried, a crash included."""
    progress.write_text("")
    child = os.fork()
    if child == 0:
        with tempfile.TemporaryDirectory() as scratch:
            for number in numbers:
                with progress.open("a") as file:
                    file.write(f"{number}\n")
                fault = _try_case(seed, number, names, sound, Path(scratch))
                if fault:
                    print(fault, flush=True)
                    os._exit(3)  # what follows might suffer from what this one left
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    tried = [int(line) for line in progress.read_text().split()]
    if os.WIFSIGNALED(status):
        print(f"case {tried[-1]}: ended by signal {os.WTERMSIG(status)}", flush=True)
    return len(tried)


def _load_everything() -> None:
    """The modules that commands import when they are first needed, so that all cases run the same program."""
    for package in (importers, navreplay, pipelines):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


def main(arguments: list[str] | None = None) -> int:
    """Prints what went wrong and how much was tried; the exit code tells whether nothing went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=np.inf, help="end after this time")
    parser.add_argument("words", nargs="*", help="parts of the names of sets, instead of all")
    chosen = parser.parse_args(arguments)
    _load_everything()
    names = [name for name in SETS if not chosen.words or any(word in name for word in chosen.words)]
    begin, tried, wrong = time.monotonic(), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in names:
            (root / "sound" / f"{name}.order").parent.mkdir(exist_ok=True)
            (root / "sound" / f"{name}.order").write_text("\n".join(make(name, root / "sound" / name)))
        number, end = chosen.first, chosen.first + chosen.count
        while number < end and time.monotonic() - begin < chosen.seconds:
            batch = range(number, min(number + _PER_CHILD, end))
            done = _try_batch(chosen.seed, batch, names, root / "sound", root / "progress")
            wrong += done < len(batch)
            tried, number = tried + done, number + done
    seconds = time.monotonic() - begin
    print(f"{tried} damaged logs (seed {chosen.seed}) of {len(names)} sets in {seconds:.0f} s, {tried / seconds:.1f} a second")
    print(f"{wrong} ended badly")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
