"""What the tables of a report say of satellites, taken from its plain data."""

from collections.abc import Mapping
from typing import Any

from pipelines.report.table import Figure, Table, figure_text

__all__ = ["satellite_figure", "satellite_tables"]


def satellite_figure(satellites: Mapping[str, Any]) -> Figure:
    """How many satellites the filter used, and how they stood."""
    used, position = satellites["used"], satellites["dilution"]["position"]
    context = f"{used['least']} to {used['most']}; PDOP {figure_text(position['p50'])}, 95 % {figure_text(position['p95'])}"
    return Figure("Satellites used", figure_text(used["p50"]), context)


def satellite_tables(satellites: Mapping[str, Any]) -> tuple[Table, ...]:
    """Dilution of precision, and a row per satellite."""
    dilutions = tuple(
        (name, *(figure_text(figures[share]) for share in ("p50", "p68", "p95", "max")))
        for name, figures in satellites["dilution"].items()
    )
    lost = (
        f"Of the pseudoranges used; in {satellites['epochs_without_dilution']} of {satellites['epochs']} epochs too few for it."
    )
    kinds = (("range", "m"), ("range_rate", "m/s"))
    rows = []
    for name, satellite in satellites["list"].items():
        low, high = satellite["elevation_deg"]
        figures = [_residual_texts(satellite[kind], unit) if kind in satellite else ("–",) * 3 for kind, unit in kinds]
        share = 100 * satellite["used"] / satellite["received"]
        cells = (f"{low:.0f}° to {high:.0f}°", figure_text(satellite["cn0_dbhz"]), str(satellite["received"]), f"{share:.0f} %")
        rows.append((name, *cells, *(text for texts in figures for text in texts)))
    header = ("", "elevation", "C/N0", "received", "used")
    columns = tuple(f"{kind} {word}" for kind, _ in (("range", ""), ("rate", "")) for word in ("rms", "mean", "rms in sigma"))
    note = "Innovations of what was used; 1 sigma is expected."
    return (
        Table("Dilution of precision", ("", "median", "p68", "p95", "max"), dilutions, lost),
        Table("Satellites", (*header, *columns), tuple(rows), note),
    )


def _residual_texts(figures: Mapping[str, Any], unit: str) -> tuple[str, str, str]:
    residual = figures["residual"]
    return figure_text(residual["rms"], unit), figure_text(residual["mean"], unit), figure_text(figures["normalised"]["rms"])
