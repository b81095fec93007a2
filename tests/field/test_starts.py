"""The heading at the start is as well known as the filter says, however the vehicle begins."""

import numpy as np
import pytest
from scipy import stats

from tests.field.starts import WAYS, judge


def covered(numbers: range) -> None:
    """Errors within the chi-square bound of their told standard deviations: in all, and for every way to start."""
    starts = [judge(number) for number in numbers]
    squares = {way: [(error / std) ** 2 for its, error, std, _ in starts if its == way] for way in WAYS}
    squares["all"] = [(error / std) ** 2 for _, error, std, _ in starts]
    for way, values in squares.items():
        assert np.sum(values) < stats.chi2.ppf(0.999, len(values)), (way, values)


def test_the_heading_of_some_random_starts_is_covered():
    covered(range(24))


@pytest.mark.slow
def test_the_heading_of_a_hundred_other_random_starts_is_covered():
    covered(range(100, 200))
