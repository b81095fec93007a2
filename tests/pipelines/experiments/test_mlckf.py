"""The experiments of Gao et al.: what the data hold, what filters are told, and when, and with what errors they start."""

from dataclasses import replace

import numpy as np
import pytest

import synthetic_logs
from pipelines.experiments import EXPERIMENTS
from pipelines.monte_carlo.experiment import run_seed


@pytest.mark.parametrize("name", ["mlckf-inaccurate-r", "mlckf-mixture"])
def test_scenarios_are_those_of_the_paper(name):
    experiment = EXPERIMENTS[name]
    log = synthetic_logs.simulate(experiment.scenario, 1)
    np.testing.assert_allclose(np.diff(log.imu.t_ns), 4e7)
    np.testing.assert_allclose(np.diff(log.fixes.t_ns), 1e9)
    np.testing.assert_allclose(np.degrees(log.truth.lla[0]) * [1, 1, 0], [34.246, 108.997, 0], atol=1e-4)
    np.testing.assert_allclose(log.truth.vel_n[0], [150, 0, 0], atol=1e-6)
    t_s = (log.fixes.t_ns - log.fixes.t_ns[0]) / 1e9
    assert t_s[-1] == 1000
    told = np.where((t_s >= 500) & (t_s < 700), 16.0, 1.0) if name == "mlckf-inaccurate-r" else np.ones(len(t_s))
    for cov, std in ((log.fixes.cov_pos, (5, 5, 8)), (log.fixes.cov_vel, (0.05, 0.05, 0.05))):
        np.testing.assert_allclose(cov, told[:, None, None] * np.diag(np.square(std)))
    usual = log.fix_errors.position[~log.fix_errors.wide] / [5, 5, 8]
    assert np.std(usual) == pytest.approx(1, abs=0.05)
    if name == "mlckf-mixture":
        wide = log.fix_errors.position[log.fix_errors.wide] / [5, 5, 8]
        assert len(wide) / len(t_s) == pytest.approx(0.2, abs=0.04)
        assert np.std(wide) == pytest.approx(8, rel=0.1)
    noise = experiment.options.imu_noise
    assert noise == experiment.scenario.imu.noise
    assert np.degrees(noise.gyro_noise) * 60 == pytest.approx(0.05)
    assert np.degrees(noise.gyro_bias_std) * 3600 == pytest.approx(0.1)


def test_filters_start_with_the_papers_errors():
    experiment = EXPERIMENTS["mlckf-mixture"]
    short = replace(experiment, scenario=synthetic_logs.with_duration(experiment.scenario, 20.0), arms=experiment.arms[:1])
    errors = run_seed(short, 1).arms["CKF"].errors[0]
    # half a second later, before the first update
    np.testing.assert_allclose(errors[:3], [8.25, 8.25, 15.25], atol=0.3)
    np.testing.assert_allclose(errors[3:6], 0.5, atol=0.05)
    np.testing.assert_allclose(np.degrees(errors[6:]) * 60, [1, 1, 1.5], atol=0.1)


def test_maximum_likelihood_is_restarted_from_what_it_is_told():
    experiment = EXPERIMENTS["mlckf-inaccurate-r"]
    arm = next(arm for arm in experiment.arms if arm.label == "MLCKF")
    shifted = replace(
        experiment.scenario,
        gnss=replace(experiment.scenario.gnss, told_windows=((60.0, 200.0, 4.0),)),
        journey=replace(experiment.scenario.journey, duration=110.0),
    )
    arms = replace(arm, restarts=(60.0,)), replace(arm, label="never", restarts=())
    outcome = run_seed(replace(experiment, scenario=shifted, arms=arms), 1)
    noise = outcome.arms["MLCKF"].noise["velocity"]
    held = (noise.t_s >= 60) & (noise.t_s < 74)
    np.testing.assert_allclose(noise.ratio[held], 16)
    assert 0.5 < np.median(noise.ratio[noise.t_s > 90]) < 2
    assert np.std(outcome.arms["never"].noise["velocity"].ratio[held]) > 0.1
