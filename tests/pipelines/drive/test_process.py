"""One drive from timeline to result: what is withheld, told, evaluated and moved."""

from dataclasses import replace

import numpy as np
import pytest

from navreplay.geodesy.earth import ned_between
from navreplay.geodesy.rotation import matrix_from_quat
from navreplay.geodesy.time_scales import week_tow_from_gps
from navreplay.timeline import LogError
from pipelines.config.spec import load_config
from pipelines.drive.compare import Setting, compare, plan_variants
from pipelines.drive.process import Drive, filter_drive, process
from pipelines.outputs import write_outputs
from pipelines.progress import show_progress
from pipelines.report.summary import headline_figures, summarise_run
from synthetic_logs.scenarios import SCENARIOS
from synthetic_logs.simulation import simulate
from synthetic_logs.writers import write

LOG = simulate(SCENARIOS["car-short"], seed=3)
DRIVE = Drive(LOG.timeline(), ())
TOW = week_tow_from_gps(LOG.fixes.t_ns)[1]


def windows_set():
    """A simulated outage of ten fixes while the car drives."""
    return f"outages.windows_gps_tow=[[{TOW[60]}, {TOW[70]}]]"


def test_withheld_fixes_are_an_outage_and_stay_in_the_timeline():
    result = filter_drive(DRIVE, load_config(None, [windows_set()]))
    assert len(result.used.fixes) == len(LOG.fixes) - 10
    assert len(result.timeline.fixes) == len(LOG.fixes)
    (outage,) = result.solution.outages
    assert outage.cause == "simulated"
    assert (outage.start_ns, outage.end_ns) == (LOG.fixes.t_ns[60], LOG.fixes.t_ns[70])
    assert result.evaluation.outages[0].end_horizontal > 0
    assert any(line.startswith("end of outage:") for line in summarise_run(result))
    assert headline_figures(result)["outage_end_horizontal_m"]["count"] == 1


def test_errors_are_those_of_the_imu_whatever_point_is_written():
    plain = filter_drive(DRIVE, load_config(None))
    moved = filter_drive(DRIVE, load_config(None, ["output.output_point_m=[1, 2, 3]"]))
    assert np.array_equal(moved.evaluation.errors["position"].error, plain.evaluation.errors["position"].error)
    offset_b = np.einsum(
        "kji,kj->ki", matrix_from_quat(plain.solution.q_nb), ned_between(plain.solution.lla, moved.solution.lla)
    )
    assert offset_b == pytest.approx(np.tile([1.0, 2.0, 3.0], (len(offset_b), 1)), abs=1e-5)


def test_without_a_reference_there_is_no_evaluation():
    result = filter_drive(Drive(replace(DRIVE.timeline, reference=None), ()), load_config(None))
    assert result.evaluation is None
    assert "errors_m" not in headline_figures(result)
    assert "no reference" in summarise_run(result)[-1]


def test_progress_tells_each_stage_from_beginning_to_end(tmp_path):
    path, truth = write(LOG, tmp_path / "car.mcap")
    told = []
    config = load_config(None, [f"input.reference.file={truth}"])
    result = process([path], config, lambda stage, fraction: told.append((stage, fraction)))
    stages = list(dict.fromkeys(stage for stage, _ in told))
    assert stages == ["reading", "checking", "filtering", "evaluating"] == list(result.timing_s)
    for stage in stages:
        fractions = [fraction for name, fraction in told if name == stage]
        assert fractions[0] == 0
        assert fractions[-1] == 1
        assert fractions == sorted(fractions)
    assert all(seconds > 0 for seconds in result.timing_s.values())


def test_an_error_of_preflight_stops_before_the_filter(tmp_path):
    path, _ = write(LOG, tmp_path / "car.csv")[:2]
    with pytest.raises(LogError, match="no GNSS fixes"):
        process([path], load_config(None))


def test_a_wrong_method_is_told_before_the_log_is_read(tmp_path):
    config = load_config(None, ["filter.name=hubber"])
    with pytest.raises(LogError, match="hubber"):
        process([tmp_path / "missing.mcap"], config)
    with pytest.raises(LogError, match="hubber"):
        plan_variants(["fixed", "hubber"], [Setting(load_config(None))])


def test_parameters_go_only_to_the_method_they_are_for(tmp_path):
    path, *_ = write(LOG, tmp_path / "car.mcap")
    config = load_config(None, ["filter.name=iae", "filter.parameters={window = 5}"])
    variants = plan_variants(["iae", "fixed"], [Setting(config)])
    iae, fixed = (outcome.result for outcome in compare([path], variants))
    assert (iae.solution.method, fixed.solution.method) == ("iae", "fixed")
    assert dict(iae.config.filter.parameters) == {"window": 5}
    assert dict(fixed.config.filter.parameters) == {}


def test_nobody_watching_means_no_bar(capsys):
    with show_progress(quiet=True) as tell:
        assert tell is None
    with show_progress(quiet=False) as tell:
        tell("reading", 0.5)
    assert capsys.readouterr().err == ""


def test_noise_that_was_estimated_can_be_taken_over(tmp_path):
    sets = ["filter.name=em-offline", "gnss.noise_scale=2.0", "imu.grade=industrial", "output.recording=false"]
    result = filter_drive(DRIVE, load_config(None, sets))
    outputs = write_outputs(result, tmp_path)
    assert "log-likelihood" in outputs["report.md"].read_text(encoding="utf-8")
    config = load_config(outputs["config.estimated.toml"])
    assert config.filter.name == "fixed"
    assert config.gnss.position_noise_scale == pytest.approx(0.5, rel=0.2)
    again = filter_drive(DRIVE, config).solution
    assert np.abs(ned_between(result.solution.lla, again.lla)).max() < 1e-6
