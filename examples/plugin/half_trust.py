"""A noise adapter of one's own: measurements count half as soon as one of them is off by more than limit sigma."""

from dataclasses import dataclass

from navreplay.adapt.fixed import Fixed
from navreplay.filters.presets import Preset
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation, chi_square


@dataclass(frozen=True, slots=True)
class HalfTrust(Fixed):
    """limit: of the normalised innovation per component."""

    limit: float = 3.0

    def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
        """R as told, or twice that."""
        square = chi_square(innovation.residual, innovation.spread + innovation.noise)
        doubted = square > self.limit**2 * len(innovation.residual)
        return Adaptation(prior, innovation.noise * (2.0 if doubted else 1.0), state)


HALF_TRUST = Preset("half-trust", "measurements count half where they are off by more than `limit` sigma", HalfTrust)
