"""What every noise adapter is: a choice of R (or of an inflated prior) inside the epoch, with a state of its own."""

from typing import Generic, NamedTuple, Protocol, TypeVar

from navreplay.filters.core import Gaussian, Innovation
from navreplay.timeline import Floats

__all__ = ["Adaptation", "NoiseAdapter"]

S = TypeVar("S")


class Adaptation(NamedTuple, Generic[S]):
    """prior: as given, or inflated. noise (m, m): the R to update with. state: for the next epoch."""

    prior: Gaussian
    noise: Floats
    state: S


class NoiseAdapter(Protocol[S]):
    """What an adapter remembers of a component it keeps by the component's label: epochs differ in what they hold (position
    alone now, with velocity then; satellites come and go)."""

    def init(self) -> S:
        """State before the first epoch."""
        ...

    def adapt(self, state: S, prior: Gaussian, innovation: Innovation) -> Adaptation[S]:
        """Choice for this epoch. Neither argument is changed."""
        ...
