"""An archive as a whole: distributions over drives and over road, growth of errors in outages, and which drives to look at."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navreplay.timeline import LogError
from pipelines.archive.catalogue import read_catalogue
from pipelines.files.remote import local

if TYPE_CHECKING:
    import pandas

__all__ = ["survey", "survey_text"]

_SHARES = (0.5, 0.68, 0.95)
_LENGTHS = (0.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0)
_LOOK_AT = 10


def survey(folder: Path) -> dict[str, Any]:
    """Plain values: by method (and vehicle, where there are several) the distributions of the horizontal error over drives and
    over distance; errors at the end of outages by their length; the drives to look at, with why. Raises LogError without a
    catalogue, or where no drive is done."""
    table = read_catalogue(folder)
    done = table[table["status"] == "done"]
    if not len(done):
        raise LogError(f"{folder}: no drive is done; `navreplay catalog {folder} --columns drive,reason` says why")
    groups = [str(name) for name in ("method", "vehicle") if done[name].nunique() > 1 or name == "method"]
    return {
        "drives": int(done["drive"].nunique()),
        "failed": int((table["status"] == "failed").sum()),
        "distance_km": float(done.drop_duplicates("drive")["distance_m"].sum() / 1000),
        "groups": [
            {"group": ", ".join(map(str, key if isinstance(key, tuple) else (key,))), **_distribution(part)}
            for key, part in done.groupby(groups)
        ],
        "outages": _outages(folder, done),
        "look_at": _look_at(table),
    }


def _distribution(part: "pandas.DataFrame") -> dict[str, Any]:
    known = part[part["horizontal_rms_m"].notna()]
    found: dict[str, Any] = {"drives": len(part), "with_reference": len(known)}
    if len(known):
        error, way = known["horizontal_rms_m"].to_numpy(), known["distance_m"].to_numpy()
        found["horizontal_rms_m"] = {f"p{100 * share:.0f}": float(np.quantile(error, share)) for share in _SHARES}
        found["horizontal_rms_m_by_distance"] = {f"p{100 * share:.0f}": _weighted(error, way, share) for share in _SHARES}
        found["position_nees_median"] = float(np.nanmedian(known["position_nees"].astype(float)))
    return found


def _weighted(values: np.ndarray, weights: np.ndarray, share: float) -> float:
    """The value below which a share of the weights lies."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order]) / max(float(weights.sum()), 1e-9)
    return float(values[order][min(int(np.searchsorted(reached, share)), len(values) - 1)])


def _outages(folder: Path, done: "pandas.DataFrame") -> list[dict[str, Any]]:
    ends: list[tuple[float, float]] = []
    for row in done.itertuples():
        path = local(folder, f"drives/{row.drive}/{row.method}/report.json")
        try:
            listed = json.loads(path.read_text(encoding="utf-8"))["outages"]["list"]
        except (OSError, ValueError, KeyError) as error:
            raise LogError(f"{path}: cannot be read ({error}); process the drive again with --resume") from error
        for one in listed:
            if one.get("end_horizontal_m") is not None:
                ends.append((one["length_s"], one["end_horizontal_m"]))
    growth = []
    for shortest, longest in zip(_LENGTHS, (*_LENGTHS[1:], np.inf), strict=True):
        inside = [error for length, error in ends if shortest <= length < longest]
        if inside:
            spread = {"median_m": float(np.median(inside)), "p95_m": float(np.quantile(inside, 0.95))}
            growth.append(
                {"from_s": shortest, "to_s": None if np.isinf(longest) else longest, "outages": len(inside), **spread}
            )
    return growth


def _look_at(table: "pandas.DataFrame") -> list[dict[str, str]]:
    """Failures, poor verdicts, then the largest errors and the worst consistency."""
    found: dict[str, str] = {}
    for row in table[table["status"] == "failed"].itertuples():
        found.setdefault(row.drive, f"failed: {row.reason}")
    for row in table[table["verdict"] == "poor"].itertuples():
        found.setdefault(row.drive, f"verdict poor with {row.method}")
    for column, words in (
        ("horizontal_rms_m", "largest horizontal error"),
        ("position_nees", "largest NEES"),
        ("outage_s", "longest outages"),
    ):
        for row in table.nlargest(3, column).itertuples():
            value = getattr(row, column)
            if value:
                found.setdefault(row.drive, f"{words}: {value:.3g} with {row.method}")
    return [{"drive": drive, "why": why} for drive, why in list(found.items())[:_LOOK_AT]]


def survey_text(values: dict[str, Any]) -> str:
    """The survey as a page of text."""
    lines = [f"{values['drives']} drives over {values['distance_km']:.1f} km, {values['failed']} runs failed", ""]
    for group in values["groups"]:
        lines.append(f"{group['group']}: {group['drives']} runs, {group['with_reference']} with a reference")
        for key, words in (("horizontal_rms_m", "over drives"), ("horizontal_rms_m_by_distance", "over distance")):
            if key in group:
                shares = ", ".join(f"{name} {value:.3g}" for name, value in group[key].items())
                lines.append(f"  horizontal rms m {words}: {shares}")
        if "position_nees_median" in group:
            lines.append(f"  position NEES, median: {group['position_nees_median']:.3g} (3 expected)")
    if values["outages"]:
        lines += ["", "horizontal error at the end of outages"]
    for one in values["outages"]:
        span = f"{one['from_s']:g} s and more" if one["to_s"] is None else f"{one['from_s']:g} to {one['to_s']:g} s"
        lines.append(f"  {span}: {one['median_m']:.3g} m median, {one['p95_m']:.3g} m 95 % ({one['outages']} outages)")
    if values["look_at"]:
        lines += ["", "to look at first"]
    lines += [f"  {one['drive']}: {one['why']}" for one in values["look_at"]]
    return "\n".join(lines)
