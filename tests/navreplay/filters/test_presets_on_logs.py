"""Every method on every kind of log: it ends, finite, within what it declares, or is refused in one line before filtering."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from navreplay.adapt.fixed import Fixed
from navreplay.evaluation.metrics import evaluate
from navreplay.filters.presets import PRESETS, build_method
from navreplay.filters.run import run_filter
from navreplay.options import AlignmentOptions, ConsiderOptions, FilterOptions, LaunchOptions
from navreplay.timeline import LogError, Timeline
from navreplay.update.adapter import Adaptation
from navreplay.update.gaussian import Gaussian, Innovation
from synthetic_logs import SCENARIOS, SyntheticLog, simulate, with_duration
from synthetic_logs.sensors.star_sensor import StarSensor

SECONDS = 40.0
SLOW = {"auto", "em-offline", "ml-ga", "mlckf-ga"}
"""Methods that take many times as long as others; they run with the slow tests."""


@lru_cache
def log_of(name: str, stars: bool = False) -> SyntheticLog:
    scenario = with_duration(SCENARIOS[name], SECONDS)
    return simulate(replace(scenario, stars=StarSensor(rate=1.0, std=float(np.radians(0.1)))) if stars else scenario, 1)


Kind = tuple[Timeline, FilterOptions]


def plain(log: SyntheticLog, **changes: object) -> Kind:
    return log.timeline(), replace(FilterOptions(imu_noise=log.scenario.imu.noise, output_rate=0.0), **changes)


def fixes() -> Kind:
    return plain(log_of("car-city"))


def ranges() -> Kind:
    return plain(log_of("ranges-open"))


def ranges_with_biases() -> Kind:
    return plain(log_of("ranges-open"), consider=ConsiderOptions(every_method="ranges"))


def ranges_alone() -> Kind:
    timeline, options = ranges()
    return replace(timeline, imu=None), options


def told_start(log: SyntheticLog) -> AlignmentOptions:
    first = log.truth
    return AlignmentOptions(position=tuple(first.lla[0]), velocity=tuple(first.vel_n[0]))


def attitudes() -> Kind:
    log = log_of("ballistic")
    return plain(log, alignment=told_start(log))


def attitudes_and_fixes() -> Kind:
    return plain(log_of("uav-flight", stars=True))


def launch() -> Kind:
    log = log_of("ballistic")
    start = told_start(log)
    assert start.position is not None
    return plain(log, alignment=start, launch=LaunchOptions(start.position, float(np.pi / 2)))


KINDS: dict[str, Callable[[], Kind]] = {
    made.__name__: made for made in (fixes, ranges, ranges_with_biases, ranges_alone, attitudes, attitudes_and_fixes, launch)
}


REFUSED = {"launch": {"ckf", "hrckf", "mcsckf", "mlckf", "mlckf-ga"}}
"""By kind, what is refused in one line: cubature points move in NED."""


def check(name: str, kind: str) -> None:
    timeline, options = KINDS[kind]()
    try:
        solution = run_filter(timeline, build_method(name), options)
    except LogError as error:
        refusal = str(error)
    else:
        refusal = ""
    if refusal:
        assert name in REFUSED.get(kind, {}), refusal
        assert "\n" not in refusal
        return
    assert timeline.reference is not None
    for column in ("lla", "vel_n", "q_nb", "cov"):
        assert np.isfinite(getattr(solution, column)).all()
    error = evaluate(solution, timeline.reference).errors["position"].error
    # of stars alone the position is that of the IMU: tens of metres after so long
    assert np.linalg.norm(error, axis=1).max() < (150.0 if kind in ("attitudes", "launch") else 60.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", [name for name in PRESETS if name not in SLOW])
def test_a_method_ends_in_bounds(name: str, kind: str) -> None:
    check(name, kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", sorted(SLOW))
def test_a_slow_method_ends_in_bounds(name: str, kind: str) -> None:
    check(name, kind)


def test_a_filter_that_leaves_the_finite_numbers_ends_in_one_line() -> None:
    """As the prior's inflation once did: what is told names the method and the time."""
    timeline, options = fixes()

    class Bursting(Fixed):
        def adapt(self, state: None, prior: Gaussian, innovation: Innovation) -> Adaptation[None]:
            late = innovation.t_ns > timeline.fixes.t_ns[20]
            return Adaptation(prior._replace(cov=prior.cov * (np.nan if late else 1.0)), innovation.noise, None)

    method = replace(build_method("fixed"), name="bursting", adapter=Bursting())
    with pytest.raises(LogError, match=r"^filter 'bursting': its state is no longer a number .* behind its start"):
        run_filter(timeline, method, options)
