"""``navreplay diff``: what changed between two reprocessings of an archive."""

import argparse
import json

from navreplay.timeline import LogError
from pipelines.archive.difference import Difference, compare_archives
from pipelines.archive.difference_page import write_difference

__all__ = ["run"]

_SHOWN = 20


def run(arguments: argparse.Namespace) -> int | None:
    """Prints the changes; 1 where a drive is lost or moved by more than the tolerance."""
    difference = compare_archives(arguments.before, arguments.after)
    beyond = difference.beyond(arguments.tolerance)
    if arguments.html is not None:
        try:
            write_difference(arguments.html, difference, arguments.before, arguments.after, arguments.tolerance)
        except OSError as error:
            raise LogError(f"{arguments.html}: cannot be written: {error.strerror}; name another file") from error
    if arguments.json:
        print(json.dumps({**difference.plain(), "beyond": len(beyond)}, indent=2))
    else:
        _show(difference, arguments.tolerance, len(beyond))
    return 1 if beyond else None


def _show(difference: Difference, tolerance: float, beyond: int) -> None:
    changed = [one for one in difference.changes if one.what != "same"]
    for one in changed[:_SHOWN]:
        moved = ""
        if one.largest_m is not None:
            place = f"{one.at_s:.1f} s ({one.lat_deg:.6f}, {one.lon_deg:.6f})"
            moved = f", apart by up to {one.largest_m:.3g} m ({one.rms_m:.3g} m rms) at {place}"
        old, new = one.figures.get("horizontal_rms_m", (None, None))
        error = f", horizontal rms {old:.3g} -> {new:.3g} m" if old is not None and new is not None else ""
        causes = f" [{', '.join(one.causes)}]" if one.causes else ""
        print(f"{one.drive} ({one.method}): {one.what}{moved}{error}{causes}")
    if len(changed) > _SHOWN:
        print(f"... and {len(changed) - _SHOWN} more")
    for text, count in list(difference.settings.items())[:_SHOWN]:
        print(f"{text} ({count} runs)")
    for figure in difference.figures:
        change = f"{figure.mean:+.3g} +- {figure.error:.2g} ({100 * figure.relative:+.1f} %)"
        print(f"{figure.figure:<22}{change:<36}{figure.word} over {figure.drives} drives")
    print(f"{len(changed)} of {len(difference.changes)} changed, {beyond} beyond {tolerance:g} m")
