"""Preflight findings and inspection: every kind of bad input is told in a plain sentence with what to set."""

from dataclasses import replace

import numpy as np
import pytest

from importers import inspect_logs, load_timeline
from importers.preflight.checks import preflight
from importers.preflight.motion_match import match_forward, match_yaw
from navreplay.geodesy.earth import move_lla
from navreplay.geodesy.rotation import flu_from_frd
from navreplay.timeline import GnssFixSeries, ImuSeries, LogError, Timeline
from synthetic_logs import SCENARIOS, simulate, write
from tests.field.promise import spoil

DRIVE = simulate(SCENARIOS["car-short"], 3)
LOG = Timeline(imu=DRIVE.imu, fixes=DRIVE.fixes, reference=DRIVE.truth)


def with_imu(**changed):
    return replace(LOG, imu=replace(LOG.imu, **changed))


def find(timeline, code):
    found = [finding for finding in preflight(timeline) if finding.code == code]
    assert len(found) == 1, [finding.code for finding in preflight(timeline)]
    assert found[0].text.endswith(".")
    return found[0]


def test_a_sound_drive_has_no_errors_or_warnings():
    assert [finding.level for finding in preflight(LOG)] == ["info"]
    assert "agree in time" in find(LOG, "time-offset").text


def test_missing_series_are_errors():
    assert find(replace(LOG, imu=None), "no-imu").level == "error"
    assert find(replace(LOG, fixes=None), "no-gnss").level == "error"


@pytest.mark.parametrize(
    ("accel", "code", "hint"),
    [
        (LOG.imu.accel / 9.80665, "accel-unit", "accel_unit = 'g'"),
        (LOG.imu.accel * 100, "accel-unit", "scale the column"),
        (LOG.imu.accel + [0, 0, 9.8], "no-gravity", "raw accelerometer"),
        (flu_from_frd(LOG.imu.accel), "upside-down", "axes = 'flu'"),
        (LOG.imu.accel[:, [0, 2, 1]], "gravity-horizontal", "taken for 'l' is 'u'"),
        (LOG.imu.accel[:, [2, 1, 0]] * -1, "gravity-horizontal", "taken for 'f' is 'u'"),
    ],
)
def test_wrong_gravity_is_an_error(accel, code, hint):
    finding = find(with_imu(accel=np.ascontiguousarray(accel)), code)
    assert finding.level == "error"
    assert hint in finding.hint


def test_a_scale_error_of_gravity_is_a_warning():
    assert find(with_imu(accel=LOG.imu.accel * 0.95), "gravity-size").level == "warning"


@pytest.mark.parametrize(("factor", "hint"), [(180 / np.pi, "deg/s"), (np.pi / 180, "rad/s")])
def test_gyro_units_are_checked_by_size_or_by_the_course(factor, hint):
    finding = find(with_imu(gyro=LOG.imu.gyro * factor), "gyro-unit")
    assert finding.level == "error"
    assert hint in finding.hint


def test_a_mirrored_yaw_rate_is_an_error():
    assert find(with_imu(gyro=LOG.imu.gyro * -1), "yaw-sign").level == "error"


@pytest.mark.parametrize(("axes", "proposed"), [("frd", "flu"), ("flu", "frd"), ("rbd", "lbu")])
def test_gyros_that_turn_against_the_forces_get_axes_of_their_own(axes, proposed):
    timeline = with_imu(gyro=LOG.imu.gyro * [1, -1, -1])
    told = replace(timeline, provenance=replace(timeline.provenance, recognised=(("input.imu.axes", axes),)))
    assert f"input.imu.gyro_axes = '{proposed}'" in find(told, "yaw-sign").hint
    assert "input.imu.gyro_axes" in find(timeline, "yaw-sign").hint
    codes = [finding.code for finding in preflight(told)]
    assert "positions-mirrored" not in codes


def test_an_x_axis_that_points_right_is_told():
    turned = {name: getattr(LOG.imu, name)[:, [1, 0, 2]] * [1, -1, 1] for name in ("gyro", "accel")}
    finding = find(with_imu(**turned), "forward-axis")
    assert "90 degrees to the left" in finding.text


@pytest.mark.parametrize("offset_s", [0.5, -1.3])
def test_the_time_offset_is_estimated(offset_s):
    late = with_imu(t_ns=LOG.imu.t_ns - round(offset_s * 1e9))
    assert match_yaw(late.imu, late.fixes).offset_s == pytest.approx(offset_s, abs=0.12)
    finding = find(late, "time-offset")
    assert finding.level == "warning"
    assert f"time_offset_s = {match_yaw(late.imu, late.fixes).offset_s:.2f}" in finding.hint


@pytest.mark.parametrize("offset_s", [18, -18])
def test_leap_seconds_between_imu_and_gnss_are_an_error(offset_s):
    finding = find(with_imu(t_ns=LOG.imu.t_ns + offset_s * 10**9), "leap-seconds")
    assert finding.level == "error"
    assert "UTC and GPS time" in finding.text


def test_one_stamp_years_ahead_costs_neither_memory_nor_the_match():
    imu = LOG.imu
    t_ns = np.append(imu.t_ns, imu.t_ns[-1] + 5 * 365 * 86_400 * 10**9)
    stray = replace(imu, t_ns=t_ns, gyro=np.vstack([imu.gyro, imu.gyro[-1:]]), accel=np.vstack([imu.accel, imu.accel[-1:]]))
    match = match_yaw(stray, LOG.fixes)
    assert match.offset_s == pytest.approx(match_yaw(imu, LOG.fixes).offset_s, abs=0.02)


def test_without_turns_no_offset_is_claimed():
    still = with_imu(gyro=np.zeros_like(LOG.imu.gyro))
    assert "cannot be estimated" in find(still, "time-offset").text
    assert match_forward(LOG.imu, LOG.fixes, 0.0).correlation > 0.9


@pytest.mark.parametrize(("length_s", "level"), [(0.2, "info"), (3.0, "warning"), (90.0, "warning")])
def test_gaps_are_told(length_s, level):
    t_ns = LOG.imu.t_ns.copy()
    t_ns[len(t_ns) // 2 :] += round(length_s * 1e9)
    finding = find(replace(with_imu(t_ns=t_ns), fixes=None), "imu-gaps")
    assert finding.level == level
    assert "1 gap of more than" in finding.text


def test_a_jump_of_hours_is_told():
    t_ns = LOG.imu.t_ns.copy()
    t_ns[-100:] += 5 * 3600 * 10**9
    assert "jumps by 5.00 h" in find(with_imu(t_ns=t_ns), "time-jump").text


def test_a_slow_and_a_short_imu_are_told():
    every = slice(None, None, len(LOG.imu) // 300)
    slow = ImuSeries(LOG.imu.t_ns[every], LOG.imu.gyro[every], LOG.imu.accel[every])
    assert find(replace(LOG, imu=slow, fixes=None), "imu-rate").level == "warning"
    short = ImuSeries(LOG.imu.t_ns[:2], LOG.imu.gyro[:2], LOG.imu.accel[:2])
    assert find(replace(LOG, imu=short, fixes=None), "short-imu").level == "error"


def test_unknown_covariances_are_told():
    unknown = LOG.fixes.cov_pos.copy()
    unknown[1:] = np.nan
    assert find(replace(LOG, fixes=replace(LOG.fixes, cov_pos=unknown)), "unknown-covariance").level == "info"
    unknown[:] = np.nan
    assert find(replace(LOG, fixes=replace(LOG.fixes, cov_pos=unknown)), "unknown-covariance").level == "warning"


def test_series_that_do_not_overlap_are_an_error():
    finding = find(with_imu(t_ns=LOG.imu.t_ns + 86_400 * 10**9), "no-overlap")
    assert finding.level == "error"
    assert "apart" in finding.text
    half = int(LOG.imu.t_ns[-1] - LOG.imu.t_ns[0]) * 7 // 10
    assert find(with_imu(t_ns=LOG.imu.t_ns + half), "little-overlap").level == "warning"


def test_a_reference_of_another_time_is_an_error():
    away = replace(LOG.reference, t_ns=LOG.reference.t_ns + 86_400 * 10**9)
    assert find(replace(LOG, reference=away), "no-reference-overlap").level == "error"
    half = replace(LOG.reference, t_ns=LOG.reference.t_ns + int(LOG.imu.t_ns[-1] - LOG.imu.t_ns[0]) * 7 // 10)
    assert find(replace(LOG, reference=half), "little-reference").level == "warning"


def test_heights_above_mean_sea_level_are_told():
    finding = find(replace(LOG, fixes=replace(LOG.fixes, lla=LOG.fixes.lla + [0, 0, 30.0])), "geoid-height")
    assert "above mean sea level" in finding.text
    assert "+3" in finding.text


def test_inspection_describes_channels_and_roles(tmp_path):
    *paths, truth = write(DRIVE, tmp_path / "log.csv")
    inspection = inspect_logs(paths, reference=truth)
    roles = {channel.role: channel for channel in inspection.channels}
    assert set(roles) == {"imu", "fix", "reference"}
    assert roles["imu"].count == len(DRIVE.imu)
    assert roles["imu"].rate_hz == pytest.approx(1e9 / np.median(np.diff(DRIVE.imu.t_ns)))
    assert roles["fix"].first_ns == DRIVE.fixes.t_ns[0]
    assert [finding.level for finding in inspection.findings] == ["info"]
    assert len(inspection.files) == 3
    assert all(len(file.sha256) == 64 for file in inspection.files)


def test_inspection_lists_open_choices(tmp_path):
    *paths, _ = write(DRIVE, tmp_path / "a.csv")
    *others, _ = write(DRIVE, tmp_path / "b.csv")
    inspection = inspect_logs([*paths, *others])
    assert {role: len(names) for role, names in inspection.candidates.items()} == {"imu": 2, "fix": 2}
    assert {finding.code for finding in inspection.findings} == {"channel-choice"}


def test_own_truth_is_never_taken_for_fixes(tmp_path):
    *_, truth = write(DRIVE, tmp_path / "log.csv")
    timeline = load_timeline([truth])
    assert timeline.fixes is None
    assert timeline.reference is not None


def test_progress_reaches_the_end_and_counts_balance(tmp_path):
    *paths, truth = write(DRIVE, tmp_path / "log.csv")
    seen = []
    timeline = load_timeline(paths, reference=truth, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert all(use.read == use.used + sum(use.rejected.values()) for use in timeline.provenance.channels)


def test_nothing_to_load_is_an_error():
    with pytest.raises(LogError, match="no log was named"):
        load_timeline([])


@pytest.mark.parametrize(
    ("mirror", "told"),
    [
        (lambda lla: lla[:, [1, 0, 2]], "latitude and longitude seem to be exchanged"),
        (lambda lla: lla * [1, -1, 1], "sign of the longitude"),
    ],
)
def test_a_mirrored_map_is_told_as_such(mirror, told: str) -> None:
    timeline = spoil("town-rtk", None).log.timeline()
    bare = np.full_like(timeline.fixes.vel_n, np.nan)
    fixes = replace(
        timeline.fixes, lla=mirror(timeline.fixes.lla), vel_n=bare, cov_vel=np.full_like(timeline.fixes.cov_vel, np.nan)
    )
    (finding,) = (one for one in preflight(replace(timeline, fixes=fixes, reference=None)) if one.level == "error")
    assert finding.code == "positions-mirrored"
    assert told in finding.text


def test_laps_are_no_evidence_of_an_offset() -> None:
    """Turns that repeat every 18 s; the true lag is none."""
    t = np.arange(0, 150, 0.01)
    yaw_rate = 0.3 * np.sin(2 * np.pi * t / 18)
    yaw = np.cumsum(yaw_rate) * 0.01
    place = np.cumsum(np.column_stack([np.cos(yaw), np.sin(yaw), 0 * t]) * 0.1, axis=0)
    t_ns = 1_300_000_000_000_000_000 + np.rint(t * 1e9).astype(np.int64)
    imu = ImuSeries(t_ns, np.column_stack([0 * t, 0 * t, yaw_rate]), np.tile([0.0, 0.0, -9.8], (len(t), 1)))
    rows = slice(0, None, 20)
    lla = move_lla(np.tile([0.84, 0.2, 500.0], (len(t[rows]), 1)), place[rows])
    n, unknown = len(lla), np.full((len(lla), 3), np.nan)
    fixes = GnssFixSeries(
        t_ns[rows], lla, unknown, np.tile(np.eye(3), (n, 1, 1)), np.full((n, 3, 3), np.nan), np.zeros(n, np.int8)
    )
    assert abs(match_yaw(imu, fixes).offset_s) < 0.1
