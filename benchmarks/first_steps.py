"""A stranger's first steps on real drives: inspect, init, run, nothing else; the raw fixes' error beside the solution's.

    python benchmarks/first_steps.py --drive NAME LOG ... [--reference FILE] [--set KEY=VALUE] [--drive NAME LOG ...]

Errors are horizontal, RMS, outside outages, against the reference, as the verdict of `run` tells them. Where a step ends with
an error its line is shown in place of figures.
"""

import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path

from pipelines import cli


def parse(arguments: list[str]) -> list[tuple[str, list[str], str | None]]:
    """Name, logs and reference of every drive."""
    drives: list[tuple[str, list[str], str | None]] = []
    words = iter(arguments)
    for word in words:
        if word == "--drive":
            drives.append((next(words), [], None))
        elif word == "--reference":
            name, logs, _ = drives.pop()
            drives.append((name, logs, str(Path(next(words)).resolve())))
        elif word == "--set":
            drives[-1][1].extend((word, next(words)))
        else:
            drives[-1][1].append(str(Path(word).resolve()))
    return drives


def call(arguments: list[str]) -> tuple[int, str]:
    """Exit code, and the last line of error."""
    told = io.StringIO()
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(io.StringIO()):
        code = cli.main(arguments)
    errors = [line for line in told.getvalue().splitlines() if line.startswith("navreplay: error")]
    return code, errors[-1].removeprefix("navreplay: error: ") if errors else ""


def steps(logs: list[str], reference: str | None, folder: Path) -> str:
    """What came of the three commands."""
    config, out = folder / "first.toml", folder / "out"
    beside = [] if reference is None else ["--reference", reference]
    code, error = call(["inspect", *logs])
    if code == 0:
        code, error = call(["init", *logs, "-o", str(config), "--force"])
    if code == 0:
        code, error = call(["run", *logs, *beside, "-c", str(config), "-o", str(out), "--quick"])
    if code:
        return f"{error}"
    verdict = json.loads((out / "report.json").read_text())["verdict"]
    against = verdict.get("beside_reference") or {}
    figures = [f"{against[key]:.2f}" if against.get(key) is not None else "-" for key in ("fixes_rms_m", "solution_rms_m")]
    return f"{figures[0]} | {figures[1]} | {verdict['grade']}"


def main() -> None:
    """A line of a table per drive."""
    print("| drive | fixes m | solution m | verdict |\n|---|---|---|---|")
    for name, logs, reference in parse(sys.argv[1:]):
        with tempfile.TemporaryDirectory() as folder:
            print(f"| {name} | {steps(logs, reference, Path(folder))} |", flush=True)


if __name__ == "__main__":
    main()
