"""Velocities against the motion of their positions: what lies is found, mended where there is one cure, and sound ones are
left."""

from dataclasses import replace

import numpy as np
import pytest

from importers.vetting.motion_fit import fit, gather_windows
from importers.vetting.velocities import vet_velocities
from synthetic_logs import SCENARIOS, simulate, with_duration
from synthetic_logs.faults import FAULTS
from tests.field.promise import DRIVES, spoil

MENDED = {
    "velocity-reversed": "velocity-axes",
    "velocity-east-sign": "velocity-axes",
    "velocity-east-north": "velocity-axes",
    "velocity-knots": "velocity-unit",
    "velocity-kmh": "velocity-unit",
    "velocity-cm": "velocity-unit",
}
LEFT_OUT = {
    "velocity-zero": "velocity-zero",
    "velocity-15-percent": "velocity-scale",
    "velocity-in-body": "velocity-contradicts",
}


@pytest.mark.parametrize("drive", ["town", "town-rtk"])
@pytest.mark.parametrize("fault", MENDED)
def test_what_has_one_cure_is_mended(drive: str, fault: str) -> None:
    true = spoil(drive, None).log.fixes
    vetted = vet_velocities(spoil(drive, fault).log.fixes)
    assert MENDED[fault] in {finding.code for finding in vetted.findings}
    given = vetted.fixes.vel_n[vetted.fixes.has_velocity]
    assert np.abs(given[:, :2] - true.vel_n[:, :2]).max() < 0.35


@pytest.mark.parametrize("drive", ["town", "town-rtk", "flight"])
@pytest.mark.parametrize("fault", LEFT_OUT)
def test_what_has_none_is_left_out(drive: str, fault: str) -> None:
    vetted = vet_velocities(spoil(drive, fault).log.fixes)
    assert [finding.code for finding in vetted.findings] == [LEFT_OUT[fault]]
    assert not vetted.fixes.has_velocity.any()
    assert vetted.velocities_out == len(vetted.fixes)
    assert vetted.fixes.has_position.all()


def test_a_vertical_part_that_was_never_filled_costs_only_itself() -> None:
    vetted = vet_velocities(spoil("flight", "velocity-no-vertical").log.fixes)
    assert [finding.code for finding in vetted.findings] == ["velocity-no-vertical"]
    assert (vetted.fixes.cov_vel[:, 2, 2] > 1e3).all()
    assert np.array_equal(vetted.fixes.cov_vel[:, :2, :2], spoil("flight", None).log.fixes.cov_vel[:, :2, :2])


def test_a_vertical_part_of_the_other_sign_is_turned() -> None:
    vetted = vet_velocities(spoil("flight", "velocity-vertical-sign").log.fixes)
    assert [finding.code for finding in vetted.findings] == ["velocity-vertical-sign"]
    assert np.array_equal(vetted.fixes.vel_n, spoil("flight", None).log.fixes.vel_n)


def test_frozen_velocities_are_left_out_from_where_they_freeze() -> None:
    fixes = spoil("town-rtk", "velocity-frozen").log.fixes
    vetted = vet_velocities(fixes)
    assert vetted.findings[0].code == "velocity-frozen"
    half = len(fixes) // 2
    assert vetted.fixes.has_velocity[: half + 1].all()
    assert not vetted.fixes.has_velocity[half + 1 :].any()


@pytest.mark.parametrize("delay", [0.13, 0.5, 1.0])
def test_late_velocities_are_taken_at_their_time(delay: float) -> None:
    fixes = spoil("town-rtk", f"velocity-late-{delay:g}s").log.fixes
    vetted = vet_velocities(fixes)
    assert [finding.code for finding in vetted.findings] == ["velocity-delay"]
    earlier = vetted.fixes.t_ns[vetted.fixes.has_velocity]
    found = (fixes.t_ns - earlier) / 1e9
    assert np.abs(found - delay).max() < 0.015
    assert vetted.fixes.has_position.sum() == len(fixes)


@pytest.mark.parametrize("name", [name for name, one in SCENARIOS.items() if one.gnss is not None and one.gnss.velocity_std])
def test_sound_velocities_are_left_alone(name: str) -> None:
    fixes = simulate(with_duration(SCENARIOS[name], 150.0), 3).fixes
    vetted = vet_velocities(fixes)
    assert vetted.findings == ()
    assert vetted.fixes is fixes


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("drive", DRIVES)
def test_no_seed_makes_a_sound_drive_doubtful(drive: str, seed: int) -> None:
    fixes = spoil(drive, None, seed).log.fixes
    assert vet_velocities(fixes).fixes is fixes


def test_scale_and_delay_are_what_they_were_made_with() -> None:
    windows = gather_windows(spoil("town-rtk", None).log.fixes)
    assert windows is not None
    parts = [part[:, :2].T.ravel() for part in (windows.moved, windows.summed, windows.changed)]
    found = fit(parts[0] * 1.25 + 0.4 * 1.25 * parts[2], parts[1], parts[2], windows.apart)
    assert found.scale == pytest.approx(1 / 1.25, abs=0.002)
    assert found.delay == pytest.approx(0.4, abs=0.02)


def test_faults_of_velocities_are_all_tried_here() -> None:
    tried = {*MENDED, *LEFT_OUT, "velocity-no-vertical", "velocity-vertical-sign", "velocity-frozen"}
    tried |= {f"velocity-late-{delay:g}s" for delay in (0.13, 0.5, 1.0)}
    assert tried == {name for name, fault in FAULTS.items() if fault.kind == "velocity"}


def test_without_motion_velocities_are_believed() -> None:
    fixes = simulate(SCENARIOS["static"], 2).fixes
    assert vet_velocities(replace(fixes, vel_n=fixes.vel_n * 3)).findings == ()
