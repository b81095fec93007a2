"""What a report says of satellites: how many, the dilution of precision, and each one's residuals and noise."""

from typing import Any

import numpy as np

from navreplay.evaluation.metrics import summarise
from navreplay.evaluation.sky import Sky
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import Floats
from pipelines.report.plain_data import plain_data

__all__ = ["describe_satellites"]

_DILUTIONS = ("geometric", "position", "horizontal", "vertical")


def describe_satellites(sky: Sky, solution: Solution) -> dict[str, Any]:
    """Plain data (keys in docs/report.md)."""
    _, received = np.unique(sky.t_ns, return_counts=True)
    kinds = [series for series in solution.innovations if series.sources]
    satellites = {}
    for name in np.unique(sky.sat).tolist():
        rows = sky.sat == name
        satellites[name] = {
            "received": int(rows.sum()),
            "judged": int(sky.judged[rows].sum()),
            "used": int(sky.used[rows].sum()),
            "elevation_deg": plain_data(np.degrees([sky.elevation[rows].min(), sky.elevation[rows].max()]).tolist()),
            "cn0_dbhz": plain_data(_median(sky.cn0[rows])),
            **{series.kind: _describe_residuals(series, name) for series in kinds},
        }
    return {
        "received": _describe_counts(received),
        "used": _describe_counts(sky.used_count),
        "epochs": len(sky.epoch_ns),
        "epochs_without_dilution": int(np.isnan(sky.dop[:, 0]).sum()),
        "dilution": {name: plain_data(summarise(sky.dop[:, i])) for i, name in enumerate(_DILUTIONS)},
        "list": satellites,
    }


def _describe_counts(counts: np.ndarray) -> dict[str, float]:
    return {"least": int(counts.min()), "p50": float(np.median(counts)), "most": int(counts.max())}


def _describe_residuals(series: InnovationSeries, name: str) -> dict[str, Any]:
    rows = (np.array(series.sources) == name) & series.used
    return {
        "residual": plain_data(summarise(series.residual[rows, 0])),
        "normalised": plain_data(summarise(series.residual[rows, 0] / series.std[rows, 0])),
        "noise_over_nominal": plain_data(_median(series.noise_std[rows, 0] / series.nominal_std[rows, 0])),
    }


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
