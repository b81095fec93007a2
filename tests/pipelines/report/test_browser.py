"""report.html in a browser: zoom, cursor, rows that lead to their time, phone, print, and no script at all."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.outputs import write_outputs
from tests.helpers.browser import Visit, open_browser
from tests.helpers.sample_drive import make_result


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    result = make_result()
    output = result.config.output.model_copy(update={"recording": False})
    write_outputs(replace(result, config=result.config.model_copy(update={"output": output})), folder)
    return folder / "report.html"


def _open(browser: Any, report: Path, width: int = 1400, **options: Any) -> Visit:
    visit = Visit(browser, report, width, **options)
    visit.page.wait_for_function("window.navreplayPage")
    visit.page.locator("figure[data-live]").nth(1).scroll_into_view_if_needed()
    visit.page.wait_for_selector("figure.drawn .uplot")
    return visit


def _view(visit: Visit) -> tuple[float, float]:
    view = visit.page.evaluate("navreplayPage.view")
    return view["lo"], view["hi"]


@pytest.mark.parametrize("width", [1400, 390])
def test_it_opens_without_errors_or_network_and_fits_the_width(browser: Any, report: Path, width: int) -> None:
    visit = _open(browser, report, width)
    for top in range(0, visit.page.evaluate("document.body.scrollHeight"), 600):
        visit.page.evaluate(f"window.scrollTo(0, {top})")
        visit.page.wait_for_timeout(30)
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= width
    assert visit.page.locator("figure[data-live]").count() == visit.page.locator("figure.drawn").count()
    assert (visit.troubles, visit.requests) == ([], [])


def test_dragging_zooms_all_plots_and_a_double_click_shows_the_whole(browser: Any, report: Path) -> None:
    visit = _open(browser, report)
    area = visit.page.locator(".u-over").first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    whole = _view(visit)
    visit.page.mouse.move(box["x"] + box["width"] * 0.25, box["y"] + 20)
    visit.page.mouse.down()
    visit.page.mouse.move(box["x"] + box["width"] * 0.5, box["y"] + 30, steps=4)
    visit.page.mouse.up()
    lo, hi = _view(visit)
    span = whole[1] - whole[0]
    assert lo == pytest.approx(0.25 * span, abs=0.02 * span)
    assert hi == pytest.approx(0.5 * span, abs=0.02 * span)
    scales = visit.page.evaluate("navreplayPage.figures.flatMap(f => f.charts).map(c => [c.scales.x.min, c.scales.x.max])")
    assert len(scales) > 3
    assert all(scale == pytest.approx([lo, hi]) for scale in scales)
    area.dblclick()
    assert _view(visit) == pytest.approx(whole)
    assert visit.troubles == []


def test_the_cursor_tells_values_with_unit_utc_and_elapsed_time_and_moves_on_the_track(browser: Any, report: Path) -> None:
    visit = _open(browser, report)
    area = visit.page.locator(".u-over").first
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    visit.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 20)
    time = visit.page.evaluate("navreplayPage.time")
    assert time == pytest.approx(30.0, abs=0.5)
    told = visit.page.locator("figure.drawn:has(.uplot) output").first.text_content()
    assert "UTC" in told
    assert " m" in told
    assert f"0:{int(time)}" in told
    track = "navreplayPage.figures.find(f => f.map)"
    pixel = visit.page.evaluate(
        f"(() => {{ const m = {track}.map; let i = m.main.t.findIndex(t => t >= navreplayPage.time);"
        " const p = m.place(m.main.east[i], m.main.north[i]), r = window.devicePixelRatio;"
        " return [...m.canvas.getContext('2d').getImageData(p[0] * r, p[1] * r, 1, 1).data]; })()"
    )
    assert pixel[3] == 255, "the cursor is not drawn on the track"


def test_a_row_of_outages_leads_there(browser: Any, report: Path) -> None:
    visit = _open(browser, report)
    row = visit.page.locator("tr[data-from]").first
    start, end = float(row.get_attribute("data-from")), float(row.get_attribute("data-to"))
    row.focus()
    visit.page.keyboard.press("Enter")
    lo, hi = _view(visit)
    assert lo <= start <= end <= hi
    assert hi - lo < 0.9 * visit.page.evaluate("navreplayPage.duration")
    assert start <= visit.page.evaluate("navreplayPage.time") <= end


def test_keys_zoom_move_and_show_the_whole(browser: Any, report: Path) -> None:
    visit = _open(browser, report)
    whole = _view(visit)
    visit.page.keyboard.press("+")
    assert _view(visit)[1] - _view(visit)[0] == pytest.approx((whole[1] - whole[0]) / 2)
    visit.page.keyboard.press("ArrowRight")
    first = visit.page.evaluate("navreplayPage.time")
    visit.page.keyboard.press("ArrowRight")
    assert visit.page.evaluate("navreplayPage.time") > first
    visit.page.keyboard.press("0")
    assert _view(visit) == pytest.approx(whole)


def test_tiles_are_asked_for_only_when_the_reader_asks(browser: Any, report: Path) -> None:
    visit = _open(browser, report)
    visit.page.get_by_role("button", name="load the background").click()
    visit.page.wait_for_timeout(200)
    assert visit.requests
    assert all(address.startswith("https://tile.openstreetmap.org/") for address in visit.requests)


def test_without_scripts_and_in_print_the_drawings_stand(browser: Any, report: Path) -> None:
    silent = Visit(browser, report, 1400, java_script_enabled=False)
    assert silent.page.locator("svg.plot").first.is_visible()
    visit = _open(browser, report, color_scheme="dark")
    assert not visit.page.locator("figure.drawn > svg.plot").first.is_visible()
    visit.page.emulate_media(media="print", color_scheme="dark")
    assert visit.page.locator("figure.drawn > svg.plot").first.is_visible()
    assert not visit.page.locator(".timebar").is_visible()
    assert visit.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
