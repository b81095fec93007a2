"""Tables out of blocks: fields that never change are held once, and nobody can tell."""

import numpy as np
import pytest

from importers.decoding.blocks import Block, Decoded, TableBuilder


class Given:
    """A decoder of columns that are given."""

    def __init__(self, columns: dict[str, np.ndarray]) -> None:
        self.columns = columns

    def decode(self, buffer: np.ndarray, start: np.ndarray, stop: np.ndarray) -> Decoded:
        return Decoded(self.columns, np.arange(len(start)))


def build(pieces: list[dict[str, np.ndarray]], expected: int) -> dict[str, np.ndarray]:
    builder, at = TableBuilder(expected), 0
    for piece in pieces:
        n = len(next(iter(piece.values())))
        block = Block(
            np.zeros(n, dtype=np.uint8), np.zeros(n, dtype=np.int64), at + np.arange(n), np.arange(n), np.arange(n) + 1
        )
        builder.add(Given(piece), block, np.arange(n))
        at += n
    table = builder.table()
    assert table.log_time_ns.tolist() == list(range(at))
    return dict(table.columns)


@pytest.mark.parametrize("expected", [1, 7, 1000])
@pytest.mark.parametrize("changes_at", [None, 0, 4, 5, 11])
def test_columns_are_what_was_added_whether_they_change_or_not(expected: int, changes_at: int | None) -> None:
    cov = np.tile(np.arange(9.0), (12, 1))
    cov[:, 3], cov[:, 4] = np.nan, -0.0
    if changes_at is not None:
        cov[changes_at, 4] = 0.0  # another sign only
    rate = np.random.default_rng(1).normal(size=(12, 3))
    pieces = [{"cov": cov[a:b], "rate": rate[a:b]} for a, b in ((0, 5), (5, 6), (6, 12))]
    columns = build(pieces, expected)
    assert columns["cov"].tobytes() == cov.tobytes()
    assert columns["rate"].tobytes() == rate.tobytes()
    assert (columns["cov"].strides[0] == 0) == (changes_at is None)


def test_a_steady_field_that_comes_later_is_unknown_before() -> None:
    cov = np.ones((3, 9))
    columns = build([{"rate": np.ones((3, 3))}, {"rate": np.ones((3, 3)), "cov": cov}], 6)
    assert np.isnan(columns["cov"][:3]).all()
    assert (columns["cov"][3:] == 1.0).all()
