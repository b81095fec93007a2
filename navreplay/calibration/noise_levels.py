"""Levels between which a measurement noise moves: a hidden Markov chain over the whole log.

An epoch's noise is told R times the level of its state. One state that is told R, one free level, or two or three of them with
free transitions: what stays for long is a step, what comes and goes from epoch to epoch a mixture (heavy tails). How many there
are the Bayesian information criterion decides (Schwarz, Annals of Statistics 6 (1978) 461), so that told R is kept unless the
log speaks against it. Baum and Welch's algorithm, as in Rabiner, Proc. IEEE 77 (1989) 257; the M-step of a level is a search.

What a chain is fed with are deletion residuals: a measurement minus what all others say of it (de Jong, Biometrika 75 (1988)
594), of covariance R + G whatever the level it was smoothed with.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from navreplay.calibration import _chain_kernel
from navreplay.timeline import Floats

__all__ = ["LEAST_EPOCHS", "Chain", "Levels", "find_levels", "ratios_of"]

_GRID = np.exp(np.arange(np.log(1e-3), np.log(1e5), 0.05))
"""Levels tried, as ratios of variance."""
_MOST = 3
_ROUNDS = 40
LEAST_EPOCHS = 20
"""Of a free level: fewer epochs than this and it is not told from chance."""


class Chain(NamedTuple):
    """One noise at k epochs, m components each, in coordinates in which told R is the identity and G diagonal: residual y
    (k, m) and G's diagonal s (k, m)."""

    residual: Floats
    spread: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Levels:
    """levels (s,): ratios of variance. first (s,), move (s, s): probabilities. log_likelihood: of the chains they were fitted
    to."""

    levels: Floats
    first: Floats
    move: Floats
    log_likelihood: float


def _densities(chain: Chain, levels: Floats) -> Floats:
    """(k, s) log-density of each epoch at each level, but for a constant."""
    variance = levels[:, None, None] + chain.spread
    return np.asarray(-0.5 * (np.log(variance) + chain.residual**2 / variance).sum(axis=2).T)


def find_levels(chains: Sequence[Chain]) -> Levels:
    """The levels of a kind of noise, shared by all its chains."""
    tables = [_densities(chain, _GRID) for chain in chains]
    count = sum(len(table) for table in tables)
    told = sum(float(_densities(chain, np.ones(1)).sum()) for chain in chains)
    best, best_score = Levels(np.ones(1), np.ones(1), np.ones((1, 1)), told), told
    if count < LEAST_EPOCHS:
        return best
    found = _fit(tables, np.array([_GRID[int(sum(table.sum(axis=0) for table in tables).argmax())]]), 1.0)
    for size in range(1, _MOST + 1):
        if size > 1:
            tries = (_fit(tables, levels, stay) for levels in _split(found.levels) for stay in (0.98, 0.6))
            found = max(tries, key=lambda one: one.log_likelihood)
        score = found.log_likelihood - 0.5 * np.log(count) * (size + size * (size - 1))
        if score > best_score:
            best, best_score = found, score
    return best


def _split(levels: Floats) -> list[Floats]:
    """Starting points with one level more."""
    low, high = levels.min(), levels.max()
    inner = [np.append(levels, np.sqrt(low * high))] if len(levels) > 1 else [np.array([low / 3, low * 3])]
    return [np.append(levels, high * 8), np.append(levels, low / 8), np.append(levels, high * 64), *inner]


def _fit(tables: Sequence[Floats], levels: Floats, stay: float) -> Levels:
    """Baum and Welch's algorithm from levels (s,) and a probability to stay."""
    size = len(levels)
    at = np.abs(np.log(_GRID)[:, None] - np.log(levels)).argmin(axis=0)
    first = np.full(size, 1 / size)
    move = np.full((size, size), (1 - stay) / max(size - 1, 1))
    np.fill_diagonal(move, stay)
    total = -np.inf
    for _ in range(_ROUNDS):
        before, total = total, 0.0
        moves, starts, gathered = np.full((size, size), 0.5), np.full(size, 0.5), np.zeros((size, len(_GRID)))
        for table in tables:
            posterior = np.empty((len(table), size))
            total += _chain_kernel.pass_chain(first, move, np.ascontiguousarray(table[:, at]), posterior, moves)
            starts += posterior[0]
            gathered += posterior.T @ table
        if total - before < 0.01:
            break
        used = at, first, move
        first, move = starts / starts.sum(), moves / moves.sum(axis=1, keepdims=True)
        at = gathered.argmax(axis=1)
    return Levels(_GRID[used[0]], used[1], used[2], max(total, before))


def ratios_of(chain: Chain, found: Levels) -> Floats:
    """(k,) by what the variance of each epoch is to be multiplied: the inverse of the expected inverse level."""
    posterior = np.empty((len(chain.residual), len(found.levels)))
    moves = np.zeros_like(found.move)
    _chain_kernel.pass_chain(found.first, found.move, _densities(chain, found.levels), posterior, moves)
    return np.asarray(1 / (posterior @ (1 / found.levels)))
