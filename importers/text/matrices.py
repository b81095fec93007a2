"""Matrices of MATLAB files (version 7 or older)."""

import numpy as np

from navreplay.timeline import LogError

__all__ = ["is_matlab", "read_matrices"]


def is_matlab(head: bytes) -> bool:
    """Whether a file begins as one of MATLAB's version 5 to 7."""
    return head.startswith(b"MATLAB 5.0 MAT-file")


def read_matrices(path: str) -> dict[str, np.ndarray]:
    """The numeric matrices (n, k) of a file by their names. Raises LogError where it cannot be read."""
    from scipy.io import loadmat  # here, because few logs are MATLAB files and it takes a while to import
    from scipy.io.matlab import MatReadError

    try:
        variables = loadmat(path)
    except (OSError, ValueError, MatReadError, NotImplementedError) as error:
        raise LogError(f"{path}: cannot be read as a MATLAB file (version 7 or older): {error}") from error
    return {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiu" and not name.startswith("__")
    }
