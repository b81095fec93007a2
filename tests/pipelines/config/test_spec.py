"""The configuration: defaults, units, round trip, and the one line a mistake is answered with."""

import json
import math
import re
import tomllib

import pytest

from navreplay.options import GRADES, ConsiderOptions, FilterOptions
from navreplay.timeline import LogError
from pipelines.config.spec import Config, apply_sets, config_keys, dump_toml, filter_options, load_config, validate
from pipelines.config.template import commented_template
from tests.helpers.paths import ROOT


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def error_of(path, *sets):
    with pytest.raises(LogError) as caught:
        load_config(path, sets)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_defaults_are_those_of_the_filter():
    """But for biases of ranges: a log from the field has them, one of an experiment those that it is given."""
    assert filter_options(Config()) == FilterOptions(consider=ConsiderOptions(every_method="ranges"))


def test_figures_of_a_data_sheet_win_over_the_grade_and_are_converted():
    config = load_config(
        None,
        [
            "imu.grade=tactical",
            "imu.gyro_noise_dps_rthz=0.01",
            "imu.accel_noise_ug_rthz=100",
            "imu.gyro_bias_std_dps=0.5",
            "imu.accel_bias_std_mg=2",
            "imu.gyro_bias_walk_dps_rts=1e-4",
            "imu.accel_bias_walk_mps2_rts=2e-5",
            "imu.gyro_bias_tau_s=300",
            "imu.accel_scale_std_ppm=500",
        ],
    )
    noise = filter_options(config).imu_noise
    assert noise.gyro_noise == pytest.approx(math.radians(0.01))
    assert noise.accel_noise == pytest.approx(100e-6 * 9.80665)
    assert noise.gyro_bias_std == pytest.approx(math.radians(0.5))
    assert noise.accel_bias_std == pytest.approx(2e-3 * 9.80665)
    assert noise.gyro_bias_walk == pytest.approx(math.radians(1e-4))
    assert noise.accel_bias_walk == 2e-5
    assert noise.gyro_bias_tau == 300
    assert noise.accel_bias_tau == math.inf
    assert noise.accel_scale_std == pytest.approx(5e-4)
    assert noise.gyro_scale_std == GRADES["tactical"].gyro_scale_std


def test_angles_of_the_alignment_become_radians():
    config = load_config(None, ["alignment.method=given", "alignment.given_deg=[1, -2, 90]", "alignment.course_std_deg=5"])
    alignment = filter_options(config).alignment
    assert alignment.method == "given"
    assert alignment.given == pytest.approx((math.radians(1), math.radians(-2), math.pi / 2))
    assert alignment.course_std == pytest.approx(math.radians(5))


def test_stds_of_fixes_without_covariance_reach_the_filter_by_status():
    options = filter_options(load_config(None, ["gnss.default_position_std_m.dead_reckoning=[20, 30]"]))
    assert options.default_position_std["DEAD_RECKONING"] == (20, 30)
    assert options.default_position_std["FIXED"] == FilterOptions().default_position_std["FIXED"]


def test_the_effective_configuration_loads_to_the_same(tmp_path):
    original = load_config(
        None,
        [
            "filter.name=huber",
            "filter.parameters={threshold = 1.5, window = 20}",
            "input.reference.file=truth.csv",
            "input.fix.lever_arm_m=[0.1, -0.2, -1.3]",
            "outages.windows_gps_tow=[[100.5, 115.5], [200, 215]]",
            "outages.week=2374",
            "imu.gyro_bias_tau_s=inf",
            "output.output_point_m=[1, 2, 3]",
        ],
    )
    again = load_config(write(tmp_path / "config.toml", dump_toml(original)))
    assert again == original
    assert dump_toml(again) == dump_toml(original)


def test_the_default_configuration_loads_to_the_same():
    assert validate(tomllib.loads(dump_toml(Config())), "config.toml") == Config()


def test_relative_paths_count_from_the_file(tmp_path):
    path = write(tmp_path / "drive.toml", '[input.reference]\nfile = "truth.csv"\n')
    assert load_config(path).input.reference.file == tmp_path / "truth.csv"


def test_windows_of_a_file_are_written_out(tmp_path):
    write(tmp_path / "windows.json", json.dumps({"week": 2374, "windows": [[10, 25], [50.5, 65.5]]}))
    config = load_config(write(tmp_path / "drive.toml", '[outages]\nfile = "windows.json"\n'))
    assert config.outages.windows_gps_tow == ((10, 25), (50.5, 65.5))
    assert config.outages.week == 2374
    assert config.outages.file is None


def test_keys_are_listed_dotted():
    keys = tuple(config_keys())
    assert "imu.grade" in keys
    assert "input.imu.axes" in keys
    assert "gnss.default_position_std_m.fixed" in keys
    assert len(keys) == len(set(keys))


def test_sets_take_toml_values_and_bare_words_and_leave_the_original_alone():
    data = {"imu": {"grade": "consumer"}}
    changed = apply_sets(data, ["imu.grade=tactical", "output.rate_hz=5", "output.recording=false", "a.b=[1, 2]"])
    assert changed == {"imu": {"grade": "tactical"}, "output": {"rate_hz": 5, "recording": False}, "a": {"b": [1, 2]}}
    assert data == {"imu": {"grade": "consumer"}}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "[imu]\ngyro_noise = 1.0",
            "drive.toml: unknown key 'imu.gyro_noise'; the nearest valid key is 'imu.gyro_noise_dps_rthz'",
        ),
        ("[inptu.imu]\naxes = 'flu'", "drive.toml: unknown key 'inptu'; the nearest valid key is 'input'"),
        ("[input.imu]\naxis = 'flu'", "drive.toml: unknown key 'input.imu.axis'; the nearest valid key is 'input.imu.axes'"),
        (
            "[imu]\ngrade = 'gold'",
            "drive.toml: imu.grade: expected 'consumer', 'industrial', 'tactical' or 'navigation', got 'gold'",
        ),
        ("[input.imu]\naccel_unit = 'gs'", "drive.toml: input.imu.accel_unit: expected 'auto', 'm/s2' or 'g', got 'gs'"),
        ("[output]\nrate_hz = '10 Hz'", "drive.toml: output.rate_hz: expected a valid number"),
        ("[output]\nrate_hz = -1", "drive.toml: output.rate_hz: expected greater than or equal to 0, got -1"),
        ("filter = 'huber'", "drive.toml: filter: expected a section with keys of its own, got 'huber'"),
        ("[alignment]\nmethod = 'given'", 'drive.toml: alignment: method = "given" needs given_deg'),
        ("[outages]\nwindows_gps_tow = [[20, 10]]", "the window [20.0, 10.0] ends before it starts"),
        ("[[input.csv]]\nmatch = '*.csv'", "drive.toml: input.csv.0.role is missing"),
        ("[imu\n", "drive.toml: not valid TOML"),
    ],
)
def test_a_mistake_is_answered_in_one_line(tmp_path, text, expected):
    assert expected in error_of(write(tmp_path / "drive.toml", text))


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    assert "no.toml: cannot read the configuration: No such file" in error_of(tmp_path / "no.toml")
    (tmp_path / "log.mcap").write_bytes(b"\x89MCAP0\r\n\xff\xfe")
    assert "were log and configuration exchanged?" in error_of(tmp_path / "log.mcap")


def test_a_file_that_holds_no_windows_is_named(tmp_path):
    windows = write(tmp_path / "windows.json", '{"windows": [[1, 2, 3]]}')
    assert f"{windows}: not an outage file" in error_of(None, f"outages.file={windows}")
    assert "cannot read the outage windows" in error_of(None, f"outages.file={tmp_path / 'none.json'}")


def test_a_mistake_on_the_command_line_is_told_as_such():
    assert error_of(None, "imu.grad=tactical").startswith("command line: unknown key 'imu.grad'")
    unknown = error_of(None, "gnss.default_position_std_m.UNKNOWN=[1,2]")
    assert "the nearest valid key is 'gnss.default_position_std_m.unknown'" in unknown
    assert "expected KEY=VALUE" in error_of(None, "imu.grade")
    assert "imu is a value, not a section" in error_of(None, "imu=1", "imu.grade=tactical")


def test_the_template_loads_to_the_configuration_it_was_made_of(tmp_path):
    config = load_config(
        None,
        [
            "input.imu.channel=/imu",
            "input.utc_date=2025-07-08",
            'input.csv=[{match = "*.csv", role = "imu", time = {column = 1}, columns = {gyro_x = 2, "accel_x" = "a x"}}]',
            "filter.parameters={threshold = 1.5}",
            "imu.gyro_bias_tau_s=inf",
            "outages.windows_gps_tow=[[1, 2.5]]",
        ],
    )
    text = commented_template(config, ["A note."])
    assert text.startswith("# A note.\n")
    assert load_config(write(tmp_path / "drive.toml", text)) == config


def test_the_template_explains_every_section_and_shows_every_key():
    text = commented_template(Config())
    sections = [line for line in text.splitlines() if line.startswith("[")]
    assert all(" # " in line for line in sections)
    for key in config_keys():
        if not key.startswith(("input.csv.", "input.message.")):
            assert re.search(rf"^(# )?{key.rpartition('.')[2]} = ", text, re.MULTILINE), key


def test_the_documentation_shows_the_template():
    page = (ROOT / "docs/configuration.md").read_text(encoding="utf-8")
    shown = page.partition("```toml\n")[2].rpartition("```")[0]
    assert shown == commented_template(Config()), (
        "put commented_template(Config()) of pipelines.config.template into docs/configuration.md"
    )
