"""A log of a star tracker from file to report: arcseconds where they are the scale, and the launch frame beside."""

import numpy as np
import pytest

from pipelines.config.spec import Config
from pipelines.drive.process import process
from pipelines.outputs import write_outputs
from synthetic_logs import SCENARIOS, simulate, with_duration, write

SETTINGS = {
    "input": {
        "imu": {"increments": True},
        "attitude": {"channel": "/stars/attitude", "frame": "earth", "sigma_arcsec": [1, 1, 1]},
    },
    "imu": {"grade": "tactical", "gyro_noise_dps_rthz": 2.8e-5, "gyro_bias_std_dps": 1.4e-4, "gyro_bias_walk_dps_rts": 0.0},
    "alignment": {"position_deg_m": [39.98, 116.34, 0.0], "position_std_m": [5.0, 5.0, 5.0]},
    "filter": {"frame": "launch-inertial"},
    "launch": {"azimuth_deg": 90.0},
}


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stars")
    log, truth = write(simulate(with_duration(SCENARIOS["ballistic"], 40.0), 6), folder / "log.mcap")
    settings = {**SETTINGS, "input": {**SETTINGS["input"], "reference": {"file": str(truth)}}}
    return write_outputs(process([log], Config.model_validate(settings)), folder / "out")


def test_the_report_speaks_in_arcseconds(outputs):
    report = outputs["report.md"].read_text(encoding="utf-8")
    assert "Inertial attitude error [arcsec]" in report
    assert "Attitude error RMS" in report
    assert "Innovations: attitude" in outputs["report.html"].read_text(encoding="utf-8")


def test_launch_csv_stands_beside_the_solution(outputs):
    table = np.genfromtxt(outputs["launch.csv"], delimiter=",", names=True)
    rows = np.genfromtxt(outputs["solution.csv"], delimiter=",", skip_header=1, usecols=5)
    np.testing.assert_allclose(table["y_m"], rows, rtol=0.01, atol=3.0)
