"""Innovation-based adaptive estimation of R (IAE).

Source: Mohamed and Schwarz, Adaptive Kalman filtering for INS/GPS, J. Geodesy 73 (1999) 193, eq. (15): R = C_nu - H P H' with
C_nu the mean of nu nu' over a window.
Two departures, for logs whose told R varies from epoch to epoch: H P H' is taken of each epoch of the window (an outage
would else be subtracted from innovations that never had it), and what is averaged is each component's ratio of estimated
to told variance, which scales the told R and keeps its correlations. With a constant diagonal R both fall away.
Assumes: the model and Q are right and the innovations of the window white, so that what is left is R.
Fails: when Q is wrong (the error goes into R), when noise changes faster than the window, and on outliers, which stay in
the window for its whole length.
When well specified: mean NEES per state 1.1 to 1.6, NIS per component 0.95 to 1.1.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from navreplay.adapt.ratio import excess_ratio, scale_noise
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Iae", "Windows"]

Windows = Mapping[str, tuple[float, ...]]
"""By label, the ratios of estimated to told variance of its last epochs."""


@dataclass(frozen=True, slots=True)
class Iae:
    """window [epochs]: length; until a component's is full the told R holds for it. floor: least ratio of used to told
    variance."""

    window: int = 30
    floor: float = 0.05

    def init(self) -> Windows:
        """No windows yet."""
        return {}

    def adapt(self, state: Windows, prior: Gaussian, innovation: Innovation) -> Adaptation[Windows]:
        """R scaled by the mean ratio of each component's window."""
        ratio = excess_ratio(innovation).tolist()
        pairs = zip(innovation.labels, ratio, strict=True)
        windows = {label: (*state.get(label, ()), value)[-self.window :] for label, value in pairs}
        full = [i for i, label in enumerate(innovation.labels) if len(windows[label]) == self.window]
        if not full:
            return Adaptation(prior, innovation.noise, {**state, **windows})
        scale = np.ones(len(ratio))
        history = np.array([windows[innovation.labels[i]] for i in full]).T
        scale[full] = np.maximum(np.ascontiguousarray(history).mean(axis=0), self.floor)
        return Adaptation(prior, scale_noise(innovation.noise, scale), {**state, **windows})
