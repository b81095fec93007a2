"""Experiments: what arms are told, statistics over seeds, verdicts on published orders, files."""

import json
from dataclasses import replace

import numpy as np
import pytest

import synthetic_logs
from navreplay.adapt.windowed.iae import Iae
from navreplay.geodesy import earth
from navreplay.timeline import LogError
from navreplay.update.gaussian import Gaussian, Innovation
from pipelines.cli import main
from pipelines.experiments import EXPERIMENTS
from pipelines.monte_carlo.experiment import (
    Arm,
    ArmOutcome,
    ConsistencyClaim,
    NoiseClaim,
    Outcome,
    Published,
    RatioClaim,
    Stretch,
    run_experiment,
    run_seed,
)
from pipelines.monte_carlo.perturbed import Perturbation
from pipelines.monte_carlo.promises import judge_consistency, judge_promises, tell_consistency, tell_promises
from pipelines.monte_carlo.report import write_experiment
from pipelines.monte_carlo.restarted import Restarted
from pipelines.monte_carlo.summary import published_orders, rmse_figures, summarise_experiment
from pipelines.monte_carlo.told_noise import NoiseRatio, StartErrors, displace_start, tell
from synthetic_logs.scenarios import SCENARIOS


def shorten(name: str, duration: float, methods: tuple[str, ...]):
    """An experiment on the first seconds of its scenario with some of its methods and the moment oracle."""
    experiment = EXPERIMENTS[name]
    arms = (*(Arm(method, method) for method in methods), Arm("oracle", "fixed", told="moments"))
    return replace(
        experiment,
        scenario=synthetic_logs.with_duration(experiment.scenario, duration),
        arms=arms,
        stretches=(Stretch("end", ((duration - 20, duration),)),),
        drawn=tuple(arm.label for arm in arms),
        published=(Published("table 1", "end", "position", {"fixed": 2.0, "srmakf": 1.0}),),
        orders=(),
        noise_claims=(NoiseClaim("R is right", "end", "range", "oracle", 0.9, 1.1),),
    )


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return run_seed(shorten("redundant-noise", 60.0, ("fixed", "srmakf")), 1)


def test_an_outcome_holds_every_arm_at_every_second(outcome):
    assert set(outcome.arms) == {"fixed", "srmakf", "oracle"}
    assert not outcome.failures
    np.testing.assert_allclose(np.diff(outcome.t_s), 1)
    known = np.isfinite(outcome.arms["fixed"].errors).all(axis=1)
    assert known.mean() > 0.9
    figures = rmse_figures(outcome.arms["fixed"].errors)
    assert 0.05 < figures["position"] < 3
    assert np.nanmean(outcome.arms["oracle"].nees[:, 0]) < 30


def test_the_oracle_uses_the_true_noise_and_the_log_tells_it_under_open_sky(outcome):
    for arm in ("fixed", "oracle"):
        for ratio in outcome.arms[arm].noise.values():
            # C/N0 scatters about the open sky's, and the filter has a floor on range rates
            assert np.median(ratio.ratio) == pytest.approx(1, abs=0.05)
    assert np.std(outcome.arms["srmakf"].noise["range"].ratio) > 0.1


def test_outcomes_do_not_depend_on_the_processes(outcome):
    experiment = shorten("redundant-noise", 60.0, ("fixed", "srmakf"))
    computed = run_experiment(experiment, 2, 2)
    assert [o.seed for o in computed] == [1, 2]
    for label, arm in computed[0].arms.items():
        np.testing.assert_array_equal(arm.errors, outcome.arms[label].errors)
        np.testing.assert_array_equal(arm.nees, outcome.arms[label].nees)
    assert not np.array_equal(computed[1].arms["fixed"].errors, outcome.arms["fixed"].errors)


def test_a_restarted_adapter_has_no_memory_of_what_was_before():
    adapter = Restarted(Iae(window=5), (100,))
    state, fresh = adapter.init(), None
    for t_ns in range(60, 160, 20):
        if t_ns == 100:
            fresh = Iae(window=5).init()
        innovation = Innovation(np.array([t_ns / 10.0]), np.eye(1), np.eye(1), np.eye(1), ("a",), t_ns)
        _, noise, state = adapter.adapt(state, Gaussian(np.zeros(1), np.eye(1)), innovation)
        if fresh is not None:
            _, expected, fresh = Iae(window=5).adapt(fresh, Gaussian(np.zeros(1), np.eye(1)), innovation)
            np.testing.assert_array_equal(noise, expected)
    remembering = Iae(window=5)
    state = remembering.init()
    for t_ns in range(60, 160, 20):
        innovation = Innovation(np.array([t_ns / 10.0]), np.eye(1), np.eye(1), np.eye(1), ("a",), t_ns)
        _, noise, state = remembering.adapt(state, Gaussian(np.zeros(1), np.eye(1)), innovation)
    assert not np.array_equal(noise, expected)


def test_a_filter_starts_with_the_errors_it_is_given():
    log = synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIOS["told-noise"], 5.0), 1)
    errors = StartErrors((8.0, -8.0, 15.0), (0.5, 0.5, -0.5))
    displaced = displace_start(tell(log, "log"), log, errors).fixes
    true = log.fix_errors.antenna
    np.testing.assert_allclose(earth.ned_between(true.lla[0], displaced.lla[0]), errors.position, atol=1e-3)
    np.testing.assert_allclose(displaced.vel_n[0] - true.vel_n[0], errors.velocity, atol=1e-12)
    np.testing.assert_allclose(np.diag(displaced.cov_pos[0]), [64.0, 64.0, 225.0])
    np.testing.assert_array_equal(displaced.lla[1:], log.fixes.lla[1:])
    np.testing.assert_array_equal(displaced.cov_vel[1:], log.fixes.cov_vel[1:])


def test_mean_noise_and_settling_are_those_of_the_components():
    t_s = np.arange(60.0) + 0.5
    true, ratio = np.tile([4.0, 9.0], (60, 1)), np.ones((60, 2))
    ratio[:50, 0], ratio[:50, 1] = 4.0, 9.0
    noise = {"position": NoiseRatio(np.repeat(t_s, 2), (true * ratio).ravel(), ratio.ravel(), ("north", "east"))}
    arm = ArmOutcome(np.zeros((60, 9)), np.ones((60, 4)), noise, 60)
    outcomes = [Outcome(1, t_s, dict.fromkeys(("fixed", "srmakf", "oracle"), arm), {}, {"fixed": 0.12})]
    experiment = shorten("redundant-noise", 60.0, ("fixed", "srmakf"))
    claim = replace(experiment.noise_claims[0], kind="position")
    experiment = replace(experiment, noise_claims=(claim,))
    outcomes[0].seconds.update(srmakf=0.0, oracle=0.0)
    report = summarise_experiment(experiment, outcomes)["arms"]["fixed"]
    end = report["stretches"]["end"]
    assert end["noise_used"]["position east"] == {"used": pytest.approx((81 * 10 + 9 * 10) / 20), "true": 9.0}
    assert end["noise_settled_s"] == {"position": 10.5}
    assert report["cpu_ms_per_epoch"] == pytest.approx(2.0)


def test_too_few_seeds_or_jobs():
    with pytest.raises(LogError, match="at least one seed and one job"):
        run_experiment(EXPERIMENTS["ermakf-city"], 0, 1)


def made_outcome(seed: int, errors: dict[str, float], nees: float = 3.0) -> Outcome:
    """Constant position errors by arm, the same at 60 epochs."""
    t_s = np.arange(60.0) + 0.5
    arms = {}
    for label, error in errors.items():
        table = np.zeros((60, 9))
        table[:, 0] = table[:, 3] = error
        table[:, 8] = np.radians(error)
        arms[label] = ArmOutcome(
            table, np.full((60, 4), nees), {"range": NoiseRatio(t_s, np.full(60, 2.1), np.full(60, 1.05))}, 60
        )
    return Outcome(seed, t_s, arms, {}, dict.fromkeys(errors, 0.1))


def summarise(published: dict[str, float], *errors: dict[str, float], nees: float = 3.0):
    experiment = shorten("redundant-noise", 60.0, ("fixed", "srmakf"))
    experiment = replace(experiment, published=(Published("table 1", "end", "position", published),))
    outcomes = [made_outcome(seed, each, nees) for seed, each in enumerate(errors, start=1)]
    return summarise_experiment(experiment, outcomes)


ERRORS = ({"fixed": 2.0, "srmakf": 1.0, "oracle": 0.5}, {"fixed": 4.0, "srmakf": 2.5, "oracle": 1.0})


def test_intervals_are_students():
    report = summarise({"fixed": 2.0, "srmakf": 1.0}, *ERRORS)
    figures = report["arms"]["fixed"]["stretches"]["end"]["rmse"]
    assert figures["position"]["mean"] == pytest.approx(3)
    # standard deviation sqrt 2, divided by sqrt 2, times t of one degree of freedom
    assert figures["position"]["half_width"] == pytest.approx(12.706, rel=1e-4)
    assert figures["attitude heading"]["mean"] == pytest.approx(3)
    difference = report["arms"]["srmakf"]["stretches"]["end"]["rmse_minus_fixed"]["position"]
    assert difference["mean"] == pytest.approx(-1.25)
    assert difference["half_width"] == pytest.approx(12.706 * 0.25, rel=1e-4)


def test_one_seed_has_no_interval_and_decides_nothing():
    report = summarise({"fixed": 2.0, "srmakf": 1.0}, ERRORS[0])
    assert report["arms"]["fixed"]["stretches"]["end"]["rmse"]["position"]["half_width"] is None
    assert report["orders"][0]["verdict"] == "undecided"


@pytest.mark.parametrize(
    ("published", "gains", "verdict"),
    [
        ({"fixed": 2.0, "srmakf": 1.0}, (1.0, 1.1, 0.9), "holds"),
        ({"fixed": 1.0, "srmakf": 2.0}, (1.0, 1.1, 0.9), "contradicted"),
        ({"fixed": 2.0, "srmakf": 1.0}, (1.0, -1.1, 0.9), "undecided"),
    ],
)
def test_verdicts_on_published_orders(published, gains, verdict):
    report = summarise(published, *({"fixed": 5 + gain, "srmakf": 5.0, "oracle": 1.0} for gain in gains))
    assert [order["verdict"] for order in report["orders"]] == [verdict]
    assert any(f"1 {'hold' if verdict == 'holds' else 'are ' + verdict}" in text for text in report["conclusions"])


def test_equal_published_figures_make_no_claim():
    experiment = EXPERIMENTS["ermakf-city"]
    claims = published_orders(experiment)
    velocity = [{claim.better, claim.worse} for claim in claims if claim.quantity == "velocity"]
    assert {"EKF", "SRMAKF"} not in velocity
    assert len(velocity) == 5
    assert len(claims) == 17


def test_consistency_counts_averages_within_their_bounds():
    honest = summarise({"fixed": 2.0, "srmakf": 1.0}, *ERRORS)["arms"]["fixed"]["stretches"]["end"]["nees"]["position"]
    assert honest == {"mean": 3.0, "share_inside": 1.0}
    lying = summarise({"fixed": 2.0, "srmakf": 1.0}, *ERRORS, nees=30.0)["arms"]["fixed"]["stretches"]["end"]["nees"][
        "position"
    ]
    assert lying == {"mean": 30.0, "share_inside": 0.0}


def test_a_failed_arm_is_told_and_left_out():
    experiment = shorten("redundant-noise", 60.0, ("fixed", "srmakf"))
    good, bad = made_outcome(1, ERRORS[0]), made_outcome(2, ERRORS[1])
    bad = replace(bad, arms={label: arm for label, arm in bad.arms.items() if label != "srmakf"}, failures={"srmakf": "lost"})
    report = summarise_experiment(experiment, [good, bad])
    assert report["arms"]["srmakf"]["failures"] == {"2": "lost"}
    assert report["arms"]["srmakf"]["stretches"]["end"]["rmse"]["position"]["seeds"] == 1


def test_files(tmp_path):
    experiment = shorten("redundant-noise", 60.0, ("fixed", "srmakf"))
    paths = write_experiment(experiment, [made_outcome(i, each) for i, each in enumerate(ERRORS, start=1)], tmp_path)
    assert set(paths) == {"experiment.json", "experiment.md", "experiment.html"}
    report = json.loads(paths["experiment.json"].read_text())
    assert report["schema"] == "navreplay experiment 1"
    assert "| fixed | 3 ± 13 |" in paths["experiment.md"].read_text()
    html = paths["experiment.html"].read_text()
    assert html.count('<svg class="plot time"') == 2
    assert "published, end" in html


def test_every_experiment_names_what_it_has():
    for experiment in EXPERIMENTS.values():
        labels = {arm.label for arm in experiment.arms}
        stretches = {stretch.name for stretch in experiment.stretches}
        names = set(rmse_figures(np.zeros((1, 9)), experiment.attitude))
        assert set(experiment.drawn) <= labels
        assert len(experiment.drawn) <= 6
        for claim in (*published_orders(experiment), *experiment.orders):
            assert {claim.better, claim.worse} <= labels
            assert claim.stretch in stretches
            assert claim.quantity in names
        for noise in experiment.noise_claims:
            assert noise.arm in labels
            assert noise.stretch in stretches
        for row in experiment.published_noise:
            assert row.arm in labels
            assert row.stretch in stretches
        for promise in (*experiment.ratios, *experiment.accepted):
            assert {promise.arm, promise.reference} <= labels
            assert promise.stretch in stretches
            assert promise.quantity in names


def test_the_moment_oracle_is_told_second_moments_and_means():
    scenario = synthetic_logs.with_duration(SCENARIOS["ermakf-city"], 300.0)
    log = synthetic_logs.simulate(scenario, 3)
    told = tell(log, "moments").ranges
    errors = log.range_truth.errors
    np.testing.assert_array_equal(told.pseudorange_std, errors.pseudorange_std)
    np.testing.assert_array_equal(told.range_rate_std, errors.range_rate_std)
    mean = errors.pseudorange_mean + log.range_truth.delays.unmodelled
    np.testing.assert_allclose(log.ranges.pseudorange - told.pseudorange, mean, atol=1e-7)
    assert np.abs(log.range_truth.delays.unmodelled).max() > 0.1
    # whitened by the moments, errors have variance one on the average of many rows
    left = (errors.pseudorange - errors.pseudorange_mean) / errors.pseudorange_std
    assert (left**2).mean() == pytest.approx(1, rel=0.3)


def test_the_clairvoyant_knows_labels_and_colour():
    scenario = synthetic_logs.with_duration(SCENARIOS["ermakf-city"], 300.0)
    log = synthetic_logs.simulate(scenario, 3)
    moments, model = tell(log, "moments").ranges, tell(log, "model").ranges
    errors, receiver = log.range_truth.errors, scenario.receiver
    t_s = (log.ranges.t_ns - scenario.journey.start_ns) / 1e9
    calm = (t_s > 150) & (t_s < 250)
    rho = np.exp(-1 / receiver.multipath_time)
    grown = receiver.multipath_std**2 * ((1 + rho) / (1 - rho) - 1)
    np.testing.assert_allclose(model.pseudorange_std[calm] ** 2 - moments.pseudorange_std[calm] ** 2, grown)
    assert errors.outlier.any()
    assert model.range_rate_std[errors.outlier].min() > 3
    assert (model.pseudorange_std > 0).all()


@pytest.mark.parametrize("name", ["mixture", "car-outliers", "car-correlated"])
def test_fixes_are_told_likewise(name):
    log = synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIOS[name], 300.0), 2)
    errors, settings = log.fix_errors, log.scenario.gnss
    moments, model = tell(log, "moments").fixes, tell(log, "model").fixes
    np.testing.assert_array_equal(moments.cov_pos, errors.cov_pos)
    variance = model.cov_pos[:, 0, 0]
    if name == "mixture":
        np.testing.assert_allclose(variance[errors.wide], (settings.mixture_scale * settings.position_std[0]) ** 2)
        np.testing.assert_allclose(variance[~errors.wide], settings.position_std[0] ** 2)
    elif name == "car-outliers":
        np.testing.assert_allclose(variance[errors.outlier], settings.position_std[0] ** 2 + 40.0**2 / 3)
    else:
        rho = np.exp(-1 / settings.correlation_time)
        np.testing.assert_allclose(variance, settings.position_std[0] ** 2 + 9 * (1 + rho) / (1 - rho))


def test_oracle_and_clairvoyant_are_told_the_biases_of_fixes():
    log = synthetic_logs.simulate(synthetic_logs.with_duration(SCENARIOS["uav-biased-fixes"], 100.0), 2)
    errors = log.fix_errors
    assert np.abs(errors.bias_pos[2]) > 0.1
    assert np.abs(errors.bias_vel).min() > 1e-3
    for knowledge in ("moments", "model"):
        told = tell(log, knowledge).fixes
        np.testing.assert_allclose(log.fixes.vel_n - told.vel_n, np.tile(errors.bias_vel, (len(told), 1)), atol=1e-12)
        np.testing.assert_allclose(earth.ned_between(told.lla[5], log.fixes.lla[5]), errors.bias_pos, atol=1e-6)
        np.testing.assert_array_equal(told.cov_pos, log.fixes.cov_pos)


def test_predictions_are_perturbed_once_an_epoch_and_not_for_those_told():
    """With fixes that count for nothing the errors add up: 3 m and 0.1 m/s in each of ten epochs."""
    whole = EXPERIMENTS["psteckf-uav"]
    scenario = synthetic_logs.with_duration(whole.scenario, 40.0)
    experiment = replace(
        whole,
        scenario=replace(scenario, gnss=replace(scenario.gnss, position_std=(1e5,) * 3, velocity_std=(1e5,) * 3)),
        arms=(Arm("wrong", "ekf"), Arm("told", "ekf", told="model")),
        perturbations=(Perturbation(11.0, 20.0, (3.0, 0.0, 0.0), (0.0, 0.1, 0.0)),),
    )
    outcome = run_seed(experiment, 1)
    shift = outcome.arms["wrong"].errors - outcome.arms["told"].errors
    before, after = (int(np.searchsorted(outcome.t_s, t)) for t in (10.5, 20.5))
    np.testing.assert_allclose(shift[before, :6], 0, atol=1e-3)
    np.testing.assert_allclose(shift[after, [0, 4]], [30, 1], atol=1e-2)


def test_an_arm_may_have_options_of_its_own():
    whole = EXPERIMENTS["psteckf-uav"]
    scenario = synthetic_logs.with_duration(whole.scenario, 40.0)
    wide = replace(whole.options, noise_scale=3.0)
    outcome = run_seed(replace(whole, scenario=scenario, arms=(Arm("all", "ekf"), Arm("own", "ekf", options=wide))), 1)
    nees = {label: np.nanmean(arm.nees[:, 0]) for label, arm in outcome.arms.items()}
    assert nees["own"] < 0.5 * nees["all"]


def test_command_lists_and_refuses(capsys, tmp_path):
    assert main(["experiment", "list"]) == 0
    assert "ermakf-city" in capsys.readouterr().out
    assert main(["experiment", "ermakf-town", "-o", str(tmp_path)]) == 1
    assert "the nearest is 'ermakf-city'" in capsys.readouterr().err
    assert main(["experiment", "ermakf-city"]) == 1
    assert "name the folder for the results with -o" in capsys.readouterr().err


def test_promises_are_kept_broken_undecided_or_only_told():
    figures = {
        "auto": {"end": {"position": np.array([1.0, 1.1, 0.9])}},
        "oracle": {"end": {"position": np.array([1.0, 1.0, 1.0])}},
    }

    def interval(values):
        return {"mean": float(values.mean()), "half_width": 0.2, "seeds": 3}

    limits = (2.0, 0.5, 1.1, None)
    claims = [RatioClaim("end", "position", "auto", "oracle", most) for most in limits]
    judged = judge_promises(claims, figures, interval)
    assert [one["verdict"] for one in judged] == ["kept", "broken", "undecided", None]
    told = tell_promises(judged)
    assert told[0].startswith("The position error of auto is 1.000 ± 0.200 times that of oracle in 'end'; that it is at most 2")
    assert told[3].endswith("of oracle in 'end'.")


def test_consistency_is_accepted_from_nine_tenths_on():
    def arm(share):
        return {"stretches": {"end": {"nees": {"position": {"mean": 3.0, "share_inside": share}}}}}

    arms = {"auto": arm(0.9), "fixed": arm(0.89), "oracle": arm(0.95)}
    claims = [ConsistencyClaim("end", "position", label, "oracle") for label in ("auto", "fixed")]
    claims.append(ConsistencyClaim("end", "gyro bias", "auto", "oracle"))
    judged = judge_consistency(claims, arms)
    assert [one["verdict"] for one in judged] == ["kept", "broken"]
    assert "89 % of the epochs are inside their bounds (oracle: 95 %)" in tell_consistency(judged)[1]
