"""Fixed noise: R as told.

Source: Kalman, J. Basic Engineering 82 (1960) 35. Assumes that the told R is the true one. Fails, by over- or
underconfidence, as soon as it is not.
When well specified: mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from dataclasses import dataclass

from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Fixed"]


@dataclass(frozen=True, slots=True)
class Fixed:
    """No adaptation and no parameters."""

    def init(self) -> None:
        """Nothing to remember."""

    def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
        """The told R."""
        return Adaptation(prior, innovation.noise, state)
