"""Prints what came of every kind: python -m tests.field.strangers.table [-v] [WORD ...]; -v with all that was printed."""

import sys
import tempfile
from pathlib import Path

from tests.field.promise import MOST
from tests.field.strangers import messages, tables
from tests.field.strangers.judge import KINDS, Kind, Steps, take_steps

__all__ = ["kept", "main"]

_MODULES = (tables, messages)


def kept(chosen: Kind, steps: Steps) -> bool:
    """Whether the promise was kept, and what had to be said was."""
    sound = len(steps.errors) == 1 if steps.codes[2] else steps.ratio <= MOST
    return sound and all(word in steps.text for word in chosen.said) and (steps.codes[2] == 1) == chosen.refused


def main() -> None:
    """A line per kind, `!` before those whose promise is not kept."""
    words = [word for word in sys.argv[1:] if word != "-v"]
    for name, chosen in KINDS.items():
        if words and not any(word in name for word in words):
            continue
        with tempfile.TemporaryDirectory() as folder:
            steps = take_steps(chosen, Path(folder))
        mark = " " if kept(chosen, steps) else "!"
        print(
            f"{mark} {name:34s}{steps.codes} fixes {steps.fixes:8.3f} m, solution {steps.solution:8.3f} m, "
            f"ratio {steps.ratio:6.2f}  {' '.join(steps.errors)}",
            flush=True,
        )
        if "-v" in sys.argv:
            print(steps.text)


if __name__ == "__main__":
    main()
