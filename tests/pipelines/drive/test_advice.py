"""The setting most likely to help, found by trying."""

from dataclasses import replace

import pytest

from navreplay.timeline import FixStatus, Timeline
from pipelines.config.spec import load_config
from pipelines.drive.advice import advise
from pipelines.drive.process import Drive, filter_drive
from synthetic_logs import SCENARIOS, GnssErrors, simulate, with_duration

FIXED = GnssErrors((0.015, 0.015, 0.03), (0.03, 0.03, 0.05), status=FixStatus.FIXED)


@pytest.fixture(scope="module")
def timeline() -> Timeline:
    base = with_duration(SCENARIOS["car-short"], 120.0)
    journey = replace(base.journey, gnss_rate=5.0, lever_b=(0.0, 0.0, 0.0))
    log = simulate(replace(base, journey=journey, gnss=FIXED), 1)
    return Timeline(imu=log.imu, fixes=log.fixes)


def test_a_time_offset_is_found_by_trying(timeline: Timeline) -> None:
    assert timeline.imu is not None
    late = replace(timeline, imu=replace(timeline.imu, t_ns=timeline.imu.t_ns + 500_000_000))
    config = load_config(None, ["filter.name=fixed"])
    result = filter_drive(Drive(late, ()), config, advised=True)
    assert result.verdict.grade == "poor"
    assert result.advice is not None
    assert result.advice.setting == "input.imu.time_offset_s=-0.2"
    assert result.advice.found < 0.3 * result.advice.told


def test_nothing_is_advised_where_no_setting_helps(timeline: Timeline) -> None:
    config = load_config(None, ["filter.name=fixed", "imu.grade=tactical"])
    result = filter_drive(Drive(timeline, ()), config, advised=True)
    assert result.verdict.grade == "good", result.verdict.faults
    assert result.advice is None  # a good run is not tried
    advice = advise(timeline, config, 0.0, result.solution)
    assert advice is not None
    assert advice.tried > 8
    assert advice.held >= 20
    assert not advice.setting


def test_without_anything_to_try_there_is_no_advice(timeline: Timeline) -> None:
    config = load_config(None, ["filter.name=fixed"])
    result = filter_drive(Drive(timeline, ()), config)
    assert result.advice is None
    fixes = timeline.fixes
    assert fixes is not None
    few = replace(
        timeline,
        fixes=replace(
            fixes, **{name: getattr(fixes, name)[:30] for name in ("t_ns", "lla", "vel_n", "cov_pos", "cov_vel", "status")}
        ),
    )
    assert advise(few, config, 0.0, result.solution) is None
