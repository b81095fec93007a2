"""Scales, ticks and thinning of the plots."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from navreplay.solution import InnovationSeries
from pipelines.plotting.means import draw_means
from pipelines.plotting.plot import bend_of, has_noise_to_show
from pipelines.plotting.scales import Scale, find_breaks, log_ticks, nice_ticks, thin_band, thin_line, time_label, time_ticks
from pipelines.plotting.svg import Layer, Panel, draw_map, draw_time_panels


@given(st.floats(-1e6, 1e6), st.floats(1e-4, 1e6))
def test_ticks_are_round_even_and_inside(low: float, width: float) -> None:
    ticks = nice_ticks(low, low + width, 5)
    assert 1 <= len(ticks) <= 7
    assert low - 1e-6 * width <= ticks[0]
    assert ticks[-1] <= low + width * (1 + 1e-6)
    if len(ticks) > 2:
        assert np.allclose(np.diff(ticks), ticks[1] - ticks[0], rtol=1e-3)


def test_time_ticks_fall_on_round_times() -> None:
    assert time_ticks(0, 548, 7) == [0, 120, 240, 360, 480]
    assert time_ticks(0, 3600, 7) == [0, 600, 1200, 1800, 2400, 3000, 3600]
    assert [time_label(t) for t in (0.0, 75.0, 3725.0, 0.5)] == ["0:00", "1:15", "1:02:05", "0.5 s"]


def test_bent_scale_keeps_order_ends_and_sign() -> None:
    scale = Scale(-20.0, 20.0, 100.0, linear_to=0.01)
    placed = scale.place(np.array([-20.0, -0.1, 0.0, 0.1, 20.0]))
    assert placed == pytest.approx([0, 100 - placed[3], 50, placed[3], 100])
    assert (np.diff(placed) > 5).all()
    assert scale.ticks(4) == [-10, -0.1, 0, 0.1, 10]


def test_bent_scale_is_chosen_only_for_wide_ranges() -> None:
    assert bend_of(np.linspace(-1, 1, 100)) is None
    assert bend_of(np.r_[np.full(100, 0.03), 20.0, np.nan]) == 0.01
    assert bend_of(np.zeros(5)) is None


def test_thinning_keeps_ends_and_peaks() -> None:
    x = np.linspace(0, 3600, 36001)
    y = np.sin(x / 100)
    y[[777, 20001]] = [50, -60]
    thin_x, thin_y = thin_line(x, y)
    assert len(thin_x) <= 1402
    assert (np.diff(thin_x) > 0).all()
    assert (thin_y.max(), thin_y.min(), thin_x[0], thin_x[-1]) == (50, -60, 0, 3600)
    band_x, low, high = thin_band(x, -np.abs(y), np.abs(y))
    assert len(band_x) <= 350
    assert (high.max(), low.min(), band_x[0], band_x[-1]) == (60, -60, 0, 3600)


def test_thinning_leaves_out_what_is_unknown() -> None:
    x, y = thin_line(np.array([0.0, 1.0, 2.0]), np.array([1.0, np.nan, 3.0]))
    assert (x.tolist(), y.tolist()) == ([0, 2], [1, 3])
    assert (
        draw_time_panels([Panel("p", (Layer("line", x, np.full(2, np.nan), "c1", "n"),))], 2.0).count('<path class="line') == 0
    )


def test_map_has_one_scale_on_both_axes_and_breaks_lines_at_gaps() -> None:
    x = np.array([0.0, 100.0, 100.0, np.nan, 0.0, 50.0])
    y = np.array([0.0, 0.0, 50.0, np.nan, 50.0, 50.0])
    svg = draw_map([Layer("line", x, y, "c1", "track")])
    path = svg.split('class="line c1" d="')[1].split('"')[0]
    pieces = [np.array(piece.split(), dtype=float).reshape(-1, 2) for piece in path.split("M")[1:]]
    assert [len(piece) for piece in pieces] == [3, 2]
    across, up = pieces[0][1] - pieces[0][0], pieces[0][2] - pieces[0][1]
    assert across[0] == pytest.approx(-2 * up[1], abs=0.4)


def test_names_are_escaped_in_drawings() -> None:
    layer = Layer("dots", np.array([0.0]), np.array([1.0]), "c1", '"><script>')
    svg = draw_time_panels([Panel("<b>", (layer,))], 1.0)
    assert "<script" not in svg
    assert "<b>" not in svg


@given(st.floats(-6, 6), st.floats(0.2, 8))
def test_log_ticks_are_inside_and_rise(first: float, decades: float) -> None:
    low, high = 10**first, 10 ** (first + decades)
    ticks = log_ticks(low, high, 5)
    assert 1 <= len(ticks) <= 12
    assert ticks == sorted(ticks)
    assert low * (1 - 1e-9) <= ticks[0]
    assert ticks[-1] <= high * (1 + 1e-9)


def test_logarithmic_scale_spaces_ratios_evenly() -> None:
    scale = Scale(0.1, 1000.0, 400.0, 0.0)
    np.testing.assert_allclose(scale.place(np.array([0.1, 1.0, 10.0, 100.0, 1000.0])), [0, 100, 200, 300, 400], atol=1e-9)


def test_a_logarithmic_panel_shows_no_noise_as_structure() -> None:
    """A ratio that is one but for rounding is a line in the middle."""
    line = Layer("line", np.arange(3.0), np.array([1.0, 1.0 + 1e-15, 1.0]), "c1", "ratio")
    drawing = draw_time_panels([Panel("ratio", (line,), 0.0)], 2.0)
    assert 'data-low="0.5" data-high="2"' in drawing


def test_mean_figures_draw_every_arm_and_what_was_published() -> None:
    rmse = {quantity: {"mean": 2.0, "half_width": 0.1, "seeds": 3} for quantity in ("position", "velocity", "attitude")}
    far = {quantity: {**figure, "mean": 200.0} for quantity, figure in rmse.items()}
    report = {
        "stretches": {"end": [[0, 1]]},
        "seeds": [1, 2, 3],
        "units": {"position": "m", "velocity": "m/s", "attitude": "deg"},
        "published": [{"stretch": "end", "quantity": "position", "figures": {"KF": 3.0}}],
        "arms": {"KF": {"stretches": {"end": {"rmse": rmse}}}, "<b>": {"stretches": {"end": {"rmse": far}}}},
    }
    (plot,) = draw_means(report)
    assert plot.svg.count(">KF<") == 3
    assert "&lt;b&gt;" in plot.svg
    assert plot.svg.count("crosses bad") == 1
    assert "published" in [name for _, name in plot.legend]


def test_no_line_leads_across_a_gap() -> None:
    x = np.concatenate([np.arange(0.0, 50.0, 0.2), np.arange(90.0, 140.0, 0.2)])
    np.testing.assert_array_equal(find_breaks(x), [250])
    assert len(find_breaks(np.arange(5.0))) == 0
    drawing = draw_time_panels([Panel("error", (Layer("line", x, np.sin(x), "c1", "error"),))], 140.0)
    path = re.search(r'class="line c1"[^>]* d="([^"]*)"', drawing)
    assert path is not None
    assert path[1].count("M") == 2


def test_noise_is_shown_where_it_changes_or_is_not_that_told() -> None:
    ones = np.full((4, 3), 0.01)
    series = InnovationSeries(
        *("standstill", ("north", "east", "down"), "m/s", np.arange(4), 0 * ones, ones, ones, ones),
        *(np.zeros(4), np.ones(4, dtype=np.bool_), ("",) * 4),
    )
    assert not has_noise_to_show(series)
    assert has_noise_to_show(replace(series, noise_std=2 * ones))
    changing = ones * np.arange(1, 5)[:, None]
    assert has_noise_to_show(replace(series, noise_std=changing, nominal_std=changing))


def test_ticks_of_a_map_stay_within_the_drawing_and_large_ones_are_short() -> None:
    edge = np.array([-1500.0, 1500.0])
    drawing = draw_map([Layer("line", edge, edge, "c1", "track")])
    for x, anchor in re.findall(r'class="tick" x="([\d.]+)"[^>]*text-anchor="(\w+)"', drawing):
        assert anchor == "end" or float(x) <= 520 - 24
    tall = draw_time_panels([Panel("count", (Layer("line", np.arange(2.0), np.array([0.0, 3e6]), "c1", "n"),))], 1.0)
    assert ">1e6<" in tall
