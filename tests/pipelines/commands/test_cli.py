"""The command line from end to end on a synthetic drive."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pipelines import cli
from pipelines.commands import run as run_command
from pipelines.config.spec import load_config

OUTPUTS = {"solution.csv", "report.json", "report.md", "report.html", "recording.rrd", "config.toml"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cli")


@pytest.fixture(scope="module")
def log(folder):
    """A synthetic log; its truth lies beside it as car.truth.csv."""
    path = folder / "car.mcap"
    assert cli.main(["synth", "car-short", "--seed", "1", "-o", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def out(folder, log):
    """The results of a run with reference."""
    path = folder / "out"
    assert cli.main(["run", str(log), "--reference", str(log.with_suffix(".truth.csv")), "-o", str(path), "--quiet"]) == 0
    return path


def error_line(capsys, *arguments):
    """What a command that must fail says: one line on standard error, nothing on standard output."""
    assert cli.main([str(argument) for argument in arguments]) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("navreplay: error: ")
    assert printed.err.count("\n") == 1
    return printed.err


def in_a_process(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "pipelines.cli", *map(str, arguments)], capture_output=True, text=True, **options
    )


def test_help_imports_nothing_heavy():
    code = (
        "import sys\nfrom pipelines import cli\n"
        "try: cli.main(['--help'])\nexcept SystemExit: pass\n"
        "print(sorted({'numpy', 'scipy', 'numba', 'pandas', 'pydantic', 'rerun', 'pyarrow', 'tqdm'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "usage: navreplay" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_run_loads_nothing_slow_that_only_few_methods_need():
    code = (
        "import sys, pipelines.drive.process, pipelines.outputs\n"
        "print(sorted({'pandas', 'scipy.optimize', 'scipy.signal', 'rerun'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_told(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("navreplay ")


def test_wrong_usage_is_exit_code_2(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["run", "a.mcap"])
    assert caught.value.code == 2
    assert "-o" in capsys.readouterr().err


def test_run_writes_every_output(out):
    assert {path.name for path in out.iterdir()} == OUTPUTS


def test_run_tells_where_results_lie_and_how_good_they_are(folder, log, capsys):
    truth = log.with_suffix(".truth.csv")
    assert cli.main(["run", str(log), "--reference", str(truth), "-o", str(folder / "told")]) == 0
    printed = capsys.readouterr().out
    assert str(folder / "told" / "solution.csv") in printed
    assert "horizontal error" in printed


def test_a_poor_run_says_so_and_fails_only_where_asked(folder, log, capsys):
    poor = ["run", str(log), "--filter", "fixed", "--set", "gnss.position_noise_scale=0.02", "--set", "output.recording=false"]
    assert cli.main([*poor, "--quick", "-o", str(folder / "poor")]) == 0
    printed = capsys.readouterr().out
    assert "verdict: poor: " in printed
    assert "of positions were rejected" in printed
    assert "most likely to help" not in printed
    assert cli.main([*poor, "--strict", "--json", "-o", str(folder / "strict")]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"]["grade"] == "poor"
    assert told["verdict"]["setting"]["tried"] > 8
    events = json.loads((folder / "strict" / "report.json").read_text())["events"]
    assert sum(warning["count"] for warning in told["warnings"]) == sum(event["level"] == "warning" for event in events) > 0


def test_a_good_run_is_good_with_strict_too(folder, log, capsys):
    assert cli.main(["run", str(log), "--strict", "--set", "output.recording=false", "-o", str(folder / "good")]) == 0
    assert "\nverdict: good: " in capsys.readouterr().out


def test_the_same_run_twice_gives_the_same_bytes(folder, log, out):
    again = folder / "again"
    assert cli.main(["run", str(log), "--reference", str(log.with_suffix(".truth.csv")), "-o", str(again), "--quiet"]) == 0
    assert (again / "solution.csv").read_bytes() == (out / "solution.csv").read_bytes()


def test_the_effective_configuration_gives_the_same_bytes(folder, log):
    sets = ["imu.grade=tactical", "gnss.noise_scale=1.3", "output.output_point_m=[0.5, 0.1, -1.0]", "outages.fix_interval_s=2"]
    first, second = folder / "configured", folder / "reconfigured"
    overrides = [word for key in sets for word in ("--set", key)]
    assert cli.main(["run", str(log), "--filter", "huber", "--rate", "5", *overrides, "-o", str(first), "--quiet"]) == 0
    assert cli.main(["run", str(log), "-c", str(first / "config.toml"), "-o", str(second), "--quiet"]) == 0
    assert (first / "solution.csv").read_bytes() == (second / "solution.csv").read_bytes()
    assert (first / "config.toml").read_bytes() == (second / "config.toml").read_bytes()


def test_json_is_for_programs(folder, log, capsys):
    truth = log.with_suffix(".truth.csv")
    assert cli.main(["run", str(log), "--reference", str(truth), "-o", str(folder / "json"), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["method"] == "checked"
    assert figures["errors_m"]["all"]["horizontal_rms"] < 3
    assert {Path(path).name for path in figures["outputs"].values()} == OUTPUTS


def test_quiet_prints_nothing(folder, log, capsys):
    assert cli.main(["run", str(log), "-o", str(folder / "quiet"), "--quiet", "--set", "output.recording=false"]) == 0
    printed = capsys.readouterr()
    assert printed.out == printed.err == ""
    assert not (folder / "quiet" / "recording.rrd").exists()


def test_the_rate_decides_the_rows(folder, log):
    for rate in (0, 2):
        arguments = ["run", str(log), "-o", str(folder / f"rate{rate}"), "--rate", str(rate), "--quiet"]
        assert cli.main([*arguments, "--set", "output.recording=false"]) == 0
    counts = [len((folder / f"rate{rate}" / "solution.csv").read_text().splitlines()) for rate in (0, 2)]
    assert 100 < counts[0] < 130
    assert 2 * counts[0] < counts[1] < 4 * counts[0]


def test_inspect_shows_channels_and_use(log, capsys):
    assert cli.main(["inspect", str(log)]) == 0
    printed = capsys.readouterr().out
    assert "sensor_msgs/msg/Imu" in printed
    assert "sensor_msgs/msg/NavSatFix" in printed
    assert cli.main(["inspect", str(log), "--json"]) == 0
    assert "channels" in json.loads(capsys.readouterr().out)


def test_init_writes_a_configuration_that_runs(folder, log):
    path = folder / "drive.toml"
    assert cli.main(["init", str(log), "-o", str(path)]) == 0
    found = load_config(path).input
    assert found.imu.channel is not None
    assert (found.imu.axes, found.imu.gyro_unit, found.imu.accel_unit) == ("flu", "rad/s", "m/s2")
    assert found.fix.velocity_frame in ("enu", "ned")
    assert cli.main(["run", str(log), "-c", str(path), "-o", str(folder / "init"), "--quiet"]) == 0


def test_compare_runs_every_method_on_the_same_drive(folder, log):
    path = folder / "compared"
    truth = log.with_suffix(".truth.csv")
    arguments = ["compare", str(log), "--reference", str(truth), "--filters", "fixed,huber", "-o", str(path), "--quiet"]
    assert cli.main(arguments) == 0
    report = json.loads((path / "report.json").read_text())
    assert "fixed" in json.dumps(report)
    assert "huber" in json.dumps(report)
    assert {method["verdict"]["grade"] for method in report["methods"].values()} == {"good"}
    assert '<section class="notice good"><h2>Verdicts: 2 good</h2>' in (path / "report.html").read_text()
    assert "| huber | good |" in (path / "report.md").read_text()


@pytest.mark.parametrize("name", cli.EXPORT_FORMATS)
def test_export_writes_each_format(folder, out, name):
    path = folder / f"exported.{name}"
    assert cli.main(["export", str(out), "--format", name, "-o", str(path)]) == 0
    assert path.stat().st_size > 1000


def test_the_command_line_knows_every_export_format():
    from pipelines.trajectory.export import EXPORT_FORMATS

    assert tuple(EXPORT_FORMATS) == cli.EXPORT_FORMATS


def test_filters_and_formats_are_listed(capsys):
    assert cli.main(["filters"]) == 0
    assert {"fixed", "iae", "sage-husa", "huber"} <= {line.split()[0] for line in capsys.readouterr().out.splitlines()}
    assert cli.main(["formats", "--json"]) == 0
    assert "mcap" in json.loads(capsys.readouterr().out)


def test_scenarios_are_listed_and_a_wrong_one_is_told(folder, capsys):
    assert cli.main(["synth", "list"]) == 0
    assert "car-short" in capsys.readouterr().out
    assert "the nearest is 'car-short'" in error_line(capsys, "synth", "car-shrt", "-o", folder / "x.mcap")
    assert "-o" in error_line(capsys, "synth", "car-short")
    assert ".xyz" in error_line(capsys, "synth", "car-short", "-o", folder / "log.xyz")


def test_what_exists_is_not_overwritten_unasked(folder, log, out, capsys):
    assert f"{out}: exists already" in error_line(capsys, "run", log, "-o", out)
    assert "exists already" in error_line(capsys, "synth", "car-short", "-o", log)
    assert "is a file" in error_line(capsys, "run", log, "-o", log)
    path = folder / "kept.toml"
    path.write_text("")
    assert "exists already" in error_line(capsys, "init", log, "-o", path)
    assert "exists already" in error_line(capsys, "export", out, "--format", "tum", "-o", path)


def test_force_overwrites(folder, log):
    path = folder / "forced"
    path.mkdir()
    (path / "report.md").write_text("old")
    arguments = ["run", str(log), "-o", str(path), "--force", "--quiet", "--set", "output.recording=false"]
    assert cli.main(arguments) == 0
    assert (path / "report.md").read_text() != "old"


def test_an_unwritable_folder_is_told_before_any_work(folder, capsys):
    (folder / "file").write_text("")
    message = error_line(capsys, "run", folder / "missing.mcap", "-o", folder / "file" / "out")
    assert "cannot write there" in message
    assert not list(folder.glob("missing*"))


def test_mistakes_in_the_input_are_one_line(folder, log, capsys):
    config = folder / "wrong.toml"
    config.write_text("[imu]\ngyro_noise = 0.1\n")
    new = folder / "never"
    assert "missing.mcap" in error_line(capsys, "run", folder / "missing.mcap", "-o", new)
    assert "nearest valid key is 'imu.gyro_noise_dps_rthz'" in error_line(capsys, "run", log, "-c", config, "-o", new)
    assert "expected 'auto', 'm/s2' or 'g'" in error_line(capsys, "run", log, "--set", "input.imu.accel_unit=gs", "-o", new)
    assert "none.toml" in error_line(capsys, "run", log, "-c", folder / "none.toml", "-o", new)
    assert "'huber'" in error_line(capsys, "run", log, "--filter", "hubber", "-o", new)
    assert "none.csv" in error_line(capsys, "run", log, "--reference", folder / "none.csv", "-o", new)
    assert "/none" in error_line(capsys, "run", log, "--set", "input.imu.channel=/none", "-o", new)
    assert "hubber" in error_line(capsys, "compare", log, "--filters", "fixed,hubber", "-o", new)
    assert "cannot read the solution; is this folder" in error_line(capsys, "export", folder / "nowhere", "--format", "tum")
    assert not new.exists()


def test_a_truncated_log_is_salvaged_and_told(folder, log, capsys):
    data = log.read_bytes()
    (folder / "cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    (folder / "stub.mcap").write_bytes(data[:200])
    arguments = ["run", str(folder / "cut.mcap"), "-o", str(folder / "cut"), "--set", "output.recording=false"]
    assert cli.main(arguments) == 0
    assert f"damaged: {folder / 'cut.mcap'}: " in capsys.readouterr().out
    assert "stub.mcap" in error_line(capsys, "run", folder / "stub.mcap", "-o", folder / "stub")


def test_ctrl_c_is_clean(folder, log, monkeypatch, capsys):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(run_command, "process", interrupt)
    assert cli.main(["run", str(log), "-o", str(folder / "interrupted")]) == 130
    assert capsys.readouterr().err == "navreplay: interrupted\n"


def test_a_reader_that_goes_away_is_no_traceback():
    process = subprocess.Popen(
        [sys.executable, "-m", "pipelines.cli", "synth", "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.close()
    _, errors = process.communicate()
    assert process.returncode == 1
    assert errors == ""
