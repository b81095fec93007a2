"""Innovation-based adaptive estimation of R and Q together.

Source: Mohamed and Schwarz, Adaptive Kalman filtering for INS/GPS, J. Geodesy 73 (1999) 193, in the form with posterior
residuals: R = C_v + H P+ H' with C_v the mean over a window of the posterior residual's square, and
Q = C_dx + P+ - F P+ F' with C_dx that of the state's correction.
R as each component's ratio to its told variance (see `iae`). Of Q the diagonal, as what it lacks: the mean of
dx^2 + P+ - P over the window, with P the prior as given, added to the prior where it is positive. Smaller than told
Q cannot become.
Assumes: changes of both are slow against the window.
Fails: one window of innovations tells the sum of R and H Q H', not how it divides. The excess is split as the gain splits
innovations, so a wrong R makes Q wrong too, and the other way round. Corrections of weakly observed states (biases) are
mostly noise.
When well specified: mean NEES per state 0.8 to 1.1, NIS per component 0.95 to 1.1.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.adapt.joint import inflate, posterior_square
from navreplay.adapt.ratio import scale_noise
from navreplay.adapt.windowed.iae import Windows
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, condition

__all__ = ["IaeQ", "Seen"]


class Seen(NamedTuple):
    """ratios: by label, of its last epochs' expected square error to the told variance. lacks: (n,) of the last epochs, what
    the prior's variances lacked."""

    ratios: Windows
    lacks: tuple[Floats, ...]


@dataclass(frozen=True, slots=True)
class IaeQ:
    """window [epochs]: length; until it is full the told R and Q hold. floor: least ratio of used to told variance."""

    window: int = 30
    floor: float = 0.05

    def init(self) -> Seen:
        """No windows yet."""
        return Seen({}, ())

    def adapt(self, state: Seen, prior: Gaussian, innovation: Innovation) -> Adaptation[Seen]:
        """Prior and R from the windows before this epoch, which joins them."""
        noise = scale_noise(innovation.noise, self._ratio(state, innovation.labels))
        used, wider = prior, innovation
        if len(state.lacks) == self.window:
            used, wider = inflate(prior, innovation, np.maximum(np.mean(state.lacks, axis=0), 0))
        posterior = condition(used, wider, noise)
        lack = (posterior.mean - prior.mean) ** 2 + np.diagonal(posterior.cov) - np.diagonal(prior.cov)
        square = posterior_square(wider, noise) / np.diagonal(innovation.noise)
        pairs = zip(innovation.labels, square.tolist(), strict=True)
        ratios = {label: (*state.ratios.get(label, ()), value)[-self.window :] for label, value in pairs}
        seen = Seen({**state.ratios, **ratios}, (*state.lacks, lack)[-self.window :])
        return Adaptation(used, noise, seen)

    def _ratio(self, state: Seen, labels: tuple[str, ...]) -> Floats:
        windows = [state.ratios.get(label, ()) for label in labels]
        means = [np.mean(values) if len(values) == self.window else 1.0 for values in windows]
        return np.maximum(np.array(means), self.floor)
