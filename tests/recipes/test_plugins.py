"""docs/recipes.md, plug-ins: examples/plugin, installed as a package would be, is found, used, and blamed where it is
broken."""

from importlib import invalidate_caches
from pathlib import Path

import numpy as np
import pytest

from navreplay import plugins
from navreplay.filters.presets import PRESETS, build_method, known_methods
from navreplay.timeline import LogError
from pipelines import cli
from synthetic_logs import simulate, with_duration, write
from synthetic_logs.scenarios import SCENARIOS
from tests.helpers.paths import ROOT

EXAMPLE = ROOT / "examples" / "plugin"


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, entry_points: str) -> None:
    """What pip leaves of a package: its metadata and its modules on the path."""
    info = folder / "navreplay_example_plugin-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: navreplay-example-plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)
    monkeypatch.syspath_prepend(str(EXAMPLE))
    monkeypatch.syspath_prepend(str(folder))
    invalidate_caches()
    plugins.load_plugins.cache_clear()


@pytest.fixture(autouse=True)
def _forget() -> None:
    yield
    plugins.load_plugins.cache_clear()


BOTH = "[navreplay.formats]\nsteps = steps_format:STEPS\n[navreplay.filters]\nhalf-trust = half_trust:HALF_TRUST\n"


def test_the_example_declares_what_is_installed_here() -> None:
    declared = (EXAMPLE / "pyproject.toml").read_text()
    assert 'steps = "steps_format:STEPS"' in declared
    assert 'half-trust = "half_trust:HALF_TRUST"' in declared
    assert all(len(path.read_text().splitlines()) < 40 for path in EXAMPLE.glob("*.py"))


def test_a_format_and_a_method_of_ones_own_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    install(tmp_path, monkeypatch, BOTH)
    log = simulate(with_duration(SCENARIOS["car-short"], 60.0), 1)
    write(log, tmp_path / "car.csv")
    columns = np.column_stack([log.imu.t_ns / 1e9, log.imu.gyro, log.imu.accel])
    np.savetxt(tmp_path / "car.steps", columns, fmt="%.9f", header="steps", comments="#")
    logs = [str(tmp_path / "car.steps"), str(tmp_path / "car.fix.csv")]
    assert (
        cli.main(["run", *logs, "--filter", "half-trust", "-o", str(tmp_path / "out"), "--set", "output.recording=false"]) == 0
    )
    assert cli.main(["formats"]) == cli.main(["filters"]) == 0
    listed = capsys.readouterr().out
    assert "steps of a made-up IMU" in listed
    assert "measurements count half" in listed


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("broken = no_such_module:THING", "cannot be loaded: ModuleNotFoundError"),
        ("broken = half_trust:HalfTrust", "is no Preset"),
        ("broken = half_trust:MISSING", "cannot be loaded: AttributeError"),
    ],
)
def test_a_broken_plug_in_is_named_with_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], entry: str, told: str
) -> None:
    install(tmp_path, monkeypatch, f"[navreplay.filters]\n{entry}\n")
    assert cli.main(["filters"]) == 1
    line = capsys.readouterr().err
    assert told in line
    assert "of package 'navreplay-example-plugin'" in line
    assert line.count("\n") == 1


def test_a_plug_in_that_fails_on_a_file_is_told_and_costs_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "careless.py").write_text(
        "from importers.formats import Format\ndef fail(*_):\n    raise KeyError('two\\nlines')\nBAD = Format('bad', 'x', "
        "(), fail)\n"
    )
    install(tmp_path, monkeypatch, "[navreplay.formats]\nbad = careless:BAD\n")
    write(simulate(with_duration(SCENARIOS["car-short"], 20.0), 1), tmp_path / "car.mcap")
    assert cli.main(["inspect", str(tmp_path / "car.mcap")]) == 0
    (tmp_path / "odd.xyz").write_bytes(b"\x00\x01\x02 nothing known")
    capsys.readouterr()
    assert cli.main(["inspect", str(tmp_path / "odd.xyz")]) == 1
    line = capsys.readouterr().err
    assert "the plug-in of format 'bad' fails on it: KeyError" in line
    assert line.count("\n") == 1


def test_a_built_in_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "[navreplay.filters]\nfixed = half_trust:HALF_TRUST\n")
    assert known_methods()["fixed"] is PRESETS["fixed"]
    with pytest.raises(LogError, match="there is no 'halftrust'; did you mean 'half-trust'"):
        build_method("halftrust")


def test_a_name_that_is_built_in_counts_and_the_plug_in_is_told_of_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "same_name.py").write_text(
        "from dataclasses import replace\nfrom half_trust import HALF_TRUST\nfrom steps_format import STEPS\n"
        "HUBER, MCAP = replace(HALF_TRUST, name='huber'), replace(STEPS, name='mcap')\n"
    )
    install(tmp_path, monkeypatch, "[navreplay.filters]\na = same_name:HUBER\n[navreplay.formats]\nb = same_name:MCAP\n")
    plugins._warn_of_name.cache_clear()
    for _ in range(2):
        assert cli.main(["filters"]) == cli.main(["formats"]) == 0
    assert known_methods()["huber"] is PRESETS["huber"]
    assert [record.message for record in caplog.records] == [
        f"warning: a plug-in of 'navreplay.{group}' is named '{name}' as one that is built in, which counts; rename the plug-in"
        for group, name in (("filters", "huber"), ("formats", "mcap"))
    ]
    assert "half" not in capsys.readouterr().out
