"""docs/recipes.md, a message type: a message that nobody knows, read by an entry of the user's configuration."""

import json
from pathlib import Path

import numpy as np
from mcap.writer import Writer

from importers.load import load_timeline
from pipelines.config.spec import load_config
from tests.helpers.log_samples import START_NS

CONFIG = """
[[input.message]]
type = "acme.Position"
role = "fix"
columns = { lat = "y", lon = "x", height = "z", std_h = "accuracy", std_d = "accuracy" }
units = { lat = "1e-7 deg", lon = "1e-7 deg", height = "mm", std_h = "mm", std_d = "mm" }
"""


def test_it_needs_an_entry_of_the_configuration_only(tmp_path: Path) -> None:
    with (tmp_path / "drive.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("acme.Position", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/where", "json", schema)
        for k in range(20):
            at = START_NS + k * 10**8
            told = {"y": 481_234_567 + k, "x": 116_000_000, "z": 512_500, "accuracy": 250}
            writer.add_message(channel, at, json.dumps(told).encode(), at)
        writer.finish()
    (tmp_path / "drive.toml").write_text(CONFIG)
    fixes = load_timeline([tmp_path / "drive.mcap"], load_config(tmp_path / "drive.toml").input).fixes
    assert fixes is not None
    np.testing.assert_allclose(np.degrees(fixes.lla[:, 0]), (481_234_567 + np.arange(20)) / 1e7, rtol=0, atol=1e-10)
    np.testing.assert_allclose(fixes.lla[:, 2], 512.5)
    np.testing.assert_allclose(fixes.cov_pos[0], np.eye(3) * 0.25**2)
