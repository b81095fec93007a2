"""What the epoch loop asks of an error model."""

from typing import Protocol

from navreplay.error_models.ned import Propagated
from navreplay.mechanisation.strapdown import Leg, NavState
from navreplay.timeline import Floats

__all__ = ["ErrorModel", "MotionModel"]


class ErrorModel(Protocol):
    """A state layout whose first nine elements are position NED [m], velocity NED [m/s] and rotation vector in n [rad]."""

    @property
    def size(self) -> int:
        """Number of error states n."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """(n,) names of the error states."""
        ...

    @property
    def units(self) -> tuple[str, ...]:
        """(n,) units of the error states."""
        ...

    def retract(self, state: NavState, correction: Floats) -> NavState:
        """The state moved by an estimated error (n,), true minus computed; or k states, stacked, by errors (k, n)."""
        ...

    def difference(self, true: NavState, computed: NavState) -> Floats:
        """(n,) the error by which `retract` takes computed to true."""
        ...

    def propagate(self, state: NavState, cov: Floats, leg: Leg) -> Propagated:
        """From state and cov (n, n) to the nodes of a leg."""
        ...


class MotionModel(ErrorModel, Protocol):
    """An error model that can carry others beside it."""

    def propagate(self, state: NavState, cov: Floats, leg: Leg, cross: Floats | None = None) -> Propagated:
        """The same with cross (n, c), the covariance with other states, as if those did not move."""
        ...
