"""A measurement at one epoch: what was measured, minus what the state predicts, with Jacobian and nominal noise."""

from typing import NamedTuple

import numpy as np

from navreplay.timeline import Floats

__all__ = ["Measurement", "join"]


class Measurement(NamedTuple):
    """residual (m,): measured minus predicted. jacobian (m, n) against the error state. noise (m, m): told R. kinds and labels
    (m,): what each component is a part of (``position``), and its own name (``north``)."""

    residual: Floats
    jacobian: Floats
    noise: Floats
    kinds: tuple[str, ...]
    labels: tuple[str, ...]

    def select(self, rows: np.ndarray) -> "Measurement":
        """The components with index in rows (k,)."""
        return Measurement(
            self.residual[rows],
            self.jacobian[rows],
            self.noise[rows[:, None], rows],
            tuple(self.kinds[i] for i in rows),
            tuple(self.labels[i] for i in rows),
        )

    def among(self, size: int) -> "Measurement":
        """The same where its n states are the first of size states, the others of which it does not see."""
        unseen = size - self.jacobian.shape[1]
        return self._replace(jacobian=np.pad(self.jacobian, ((0, 0), (0, unseen)))) if unseen else self


def join(parts: list[Measurement]) -> Measurement:
    """One measurement of all components of several, their noises independent."""
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.residual) for part in parts]
    noise = np.zeros((sum(sizes), sum(sizes)))
    start = 0
    for part, size in zip(parts, sizes, strict=True):
        noise[start : start + size, start : start + size] = part.noise
        start += size
    return Measurement(
        np.concatenate([part.residual for part in parts]),
        np.concatenate([part.jacobian for part in parts]),
        noise,
        tuple(kind for part in parts for kind in part.kinds),
        tuple(label for part in parts for label in part.labels),
    )
