"""What a gate says of an epoch, whichever gate it is."""

from typing import Protocol

import numpy as np

from navreplay.timeline import Floats
from navreplay.update.gaussian import Innovation
from navreplay.update.record import Recorder
from navreplay.update.reopening import Widening

__all__ = ["EpochGate", "Verdict"]


class Verdict(Protocol):
    """What a gate says of an epoch."""

    @property
    def passed(self) -> np.ndarray:
        """(k,) indices of the components to use."""
        ...

    @property
    def widenings(self) -> tuple[Widening, ...]:
        """How the prior covariance must grow, where the gate had to be reopened."""
        ...

    def record(self, recorder: Recorder, t_ns: int, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> None:
        """Puts the components into the record with the verdict on them."""
        ...


class EpochGate(Protocol):
    """Judges the innovations of an epoch."""

    def judge(self, kinds: tuple[str, ...], innovation: Innovation, noise: Floats) -> Verdict:
        """The verdict on an innovation with R = noise (m, m) whose components are of the given kinds (m,)."""
        ...
