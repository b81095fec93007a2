"""What a gate says of an epoch, whichever gate it is."""

from typing import Protocol

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation
from navreplay.update.record import Recorder

__all__ = ["EpochGate", "Verdict"]


class Verdict(Protocol):
    """What a gate says of an epoch."""

    @property
    def passed(self) -> np.ndarray:
        """(k,) indices of the components to use."""
        ...

    @property
    def inflation(self) -> float:
        """Factor on the prior covariance, above 1 where the gate had to be reopened."""
        ...

    @property
    def run(self) -> int:
        """Rejected epochs in a row."""
        ...

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdict on them."""
        ...


class EpochGate(Protocol):
    """Judges the innovations of an epoch."""

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        ...
