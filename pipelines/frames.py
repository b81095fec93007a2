"""Results as tables for notebooks: columns with units in their names, indexed by UTC."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self

import numpy as np

from navreplay.evaluation.metrics import Evaluation
from navreplay.geodesy.time_scales import utc_from_gps
from navreplay.solution import InnovationSeries, Solution
from navreplay.timeline import LogError, Times
from pipelines.trajectory.solution_csv import solution_columns

if TYPE_CHECKING:
    import pandas
    import pyarrow

__all__ = ["Frame", "TabularSolution", "error_frame", "innovation_frame"]


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """A table over times t_ns (k,) [GPS ns]: columns by name, each (k,)."""

    t_ns: Times
    columns: Mapping[str, np.ndarray]

    def to_pandas(self) -> "pandas.DataFrame":
        """With a DatetimeIndex in UTC."""
        import pandas

        index = pandas.DatetimeIndex(np.asarray(utc_from_gps(self.t_ns)).astype("datetime64[ns]"), tz="UTC", name="utc")
        return pandas.DataFrame(dict(self.columns), index=index)

    def to_arrow(self) -> "pyarrow.Table":
        """With the time as the first column, utc."""
        import pyarrow

        utc = np.asarray(utc_from_gps(self.t_ns)).astype("datetime64[ns]")
        return pyarrow.table({"utc": pyarrow.array(utc, pyarrow.timestamp("ns", "UTC")), **self.columns})


@dataclass(frozen=True, eq=False, slots=True)
class TabularSolution(Solution):
    """A solution that a notebook can take apart: the columns of solution.csv."""

    @classmethod
    def of(cls, solution: Solution) -> Self:
        """The same solution."""
        return cls(**{field.name: getattr(solution, field.name) for field in fields(Solution)})

    def to_pandas(self) -> "pandas.DataFrame":
        """The columns of solution.csv, with a DatetimeIndex in UTC."""
        return Frame(self.t_ns, solution_columns(self)).to_pandas()

    def to_arrow(self) -> "pyarrow.Table":
        """The columns of solution.csv, with the time as the first column, utc."""
        return Frame(self.t_ns, solution_columns(self)).to_arrow()


def error_frame(evaluation: Evaluation | None) -> Frame:
    """Errors against the reference at its epochs, by quantity and component, with in_outage. Raises LogError without one."""
    if evaluation is None:
        raise LogError("the run had no reference; give one with config input.reference, or as reference of read_drive")
    columns: dict[str, np.ndarray] = {}
    for quantity, series in evaluation.errors.items():
        for label, values in zip(series.labels, series.error.T, strict=True):
            columns[f"{quantity}_{label}"] = values
    return Frame(evaluation.t_ns, {**columns, "in_outage": evaluation.in_outage})


def innovation_frame(series: InnovationSeries) -> Frame:
    """Residuals, standard deviations, normalised square, and whether used and why not; of ranges a row per satellite."""
    columns: dict[str, np.ndarray] = {}
    for name, values in (("residual", series.residual), ("std", series.std), ("noise_std", series.noise_std)):
        for label, column in zip(series.labels, values.T, strict=True):
            columns[f"{name}_{label}" if len(series.labels) > 1 else name] = column
    columns |= {"nis": series.nis, "used": series.used, "reason": np.array(series.reason, dtype=object)}
    if series.sources:
        columns = {"source": np.array(series.sources, dtype=object), **columns}
    return Frame(series.t_ns, columns)
