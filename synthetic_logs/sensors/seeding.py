"""Random numbers by seed and purpose."""

from zlib import crc32

from numpy.random import Generator, default_rng

__all__ = ["generator_for"]


def generator_for(seed: int, purpose: str) -> Generator:
    """The generator of one purpose, such as ``gyro noise``: independent of those of all other purposes and seeds, so that an
    error that is added or changed leaves all other draws as they are. seed: 0 or more."""
    return default_rng([seed, crc32(purpose.encode())])
