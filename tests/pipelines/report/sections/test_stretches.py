"""The worst stretches and the grades of a run."""

from dataclasses import replace

import numpy as np

from navreplay.evaluation.metrics import evaluate
from navreplay.geodesy.earth import move_lla
from pipelines.report.sections.grades import grade_of
from pipelines.report.sections.stretches import stretch_tables
from tests.helpers.sample_drive import make_result, make_solution


def test_grades_are_bounded_by_what_they_say() -> None:
    sizes = np.array([0.0, 0.05, 0.051, 0.2, 0.5, 1.5, 5.0, 5.1, np.nan])
    np.testing.assert_array_equal(grade_of(sizes), [1, 1, 2, 2, 3, 4, 5, 6, np.nan])


def test_an_error_that_the_covariance_does_not_tell_comes_first_and_is_said_to_be() -> None:
    result = make_result(make_solution(duration_s=200, outage_every_s=400))
    solution = result.solution
    off = np.zeros((len(solution), 3))
    off[1205:1215, 0] = 50.0
    wrong = replace(solution, lla=move_lla(solution.lla, off))
    result = replace(result, solution=wrong, evaluation=evaluate(wrong, result.timeline.reference))
    worst, grades = stretch_tables(result)
    low, high = worst.spans[0]
    assert low < 121.0 < high
    assert "times sigma" in worst.rows[0][-1]
    starts = sorted(span[0] for span in worst.spans if span)
    assert len(starts) == 5
    shares = [float(row[2].removesuffix(" %")) for row in grades.rows]
    assert abs(sum(shares) - 100) < 0.5
    assert shares[5] > 0


def test_an_outage_is_named_as_the_cause_and_sigma_judges_without_a_reference() -> None:
    worst, grades = stretch_tables(make_result(make_solution(duration_s=120), with_reference=False))
    assert "without positions" in worst.rows[0][-1]
    assert worst.note.startswith("Worst by sigma")
    assert all(row[2] == "–" for row in grades.rows)
