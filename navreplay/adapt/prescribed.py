"""R prescribed for every epoch, as found from the whole log.

Equations: R_k = D T_k D with T_k the told R and D the root of the epoch's ratios.
Assumes: the ratios were found for this very log; an epoch that they do not cover keeps its told R.
Fails: on another log, or with other measurements chosen.
When well specified (all ratios 1): mean NEES per state 0.9 to 1.1, NIS per component 0.95 to 1.05.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from navreplay.adapt.ratio import scale_noise
from navreplay.timeline import Floats
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation

__all__ = ["Prescribed"]


@dataclass(frozen=True, eq=False, slots=True)
class Prescribed:
    """ratios: by epoch [ns], (m,) ratio of used to told variance of its first components; those behind keep their told R."""

    ratios: Mapping[int, Floats] = field(default_factory=dict)

    def init(self) -> None:
        """Nothing to remember."""

    def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
        """The told R scaled as prescribed."""
        ratio = self.ratios.get(innovation.t_ns)
        if ratio is None:
            return Adaptation(prior, innovation.noise, state)
        kept = np.ones(len(innovation.residual) - len(ratio))
        noise = scale_noise(innovation.noise, np.append(ratio, kept))
        return Adaptation(prior, noise, state)
