"""Prints the promise for every drive and fault: python -m tests.field.table [WORD ...]; a word is part of a drive or fault."""

import sys
import tempfile
from pathlib import Path

from synthetic_logs.faults import FAULTS
from tests.field.promise import DRIVES, judge


def main() -> None:
    """One line per drive and fault."""
    words = sys.argv[1:]
    outcomes = []
    print(f"{'drive':16s}{'fault':30s}{'fixes m':>9s}{'solution':>10s}{'ratio':>8s}{'largest':>9s}  said")
    for drive in DRIVES:
        for fault in (None, *FAULTS):
            if words and not any(word in f"{drive}/{fault}" for word in words):
                continue
            if drive == "town-positions" and fault and "velocity" in fault:
                continue
            with tempfile.TemporaryDirectory() as folder:
                outcome = judge(drive, fault, Path(folder))
            outcomes.append(outcome)
            mark = " " if outcome.kept else "!"
            print(
                f"{drive:16s}{outcome.fault:30s}{outcome.fixes:9.3f}{outcome.solution:10.3f}{outcome.ratio:8.2f}"
                f"{outcome.peak:9.2f} {mark}{outcome.code} {outcome.said[:150]}",
                flush=True,
            )
    print(f"{sum(outcome.kept for outcome in outcomes)} of {len(outcomes)} kept")


if __name__ == "__main__":
    main()
