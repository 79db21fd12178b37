"""Pages in a real browser: no error, no network, no barrier, and the attitude that was saved."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.pages import body_about, run_dataset
from helpers.tools import executable, needs
from jaxsat.core.attitude import Quaternion
from jaxsat.report.page import report_page

BROWSER = executable("chromium")
OPTIONS = (
    *("--no-sandbox", "--disable-gpu", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
)

pytestmark = [
    pytest.mark.slow,
    needs("chromium"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=BROWSER, args=list(OPTIONS))
        yield made
        made.close()


@pytest.fixture
def opened(browser, tmp_path):
    """Open a page from a file; gives it with all that the browser had to say against it."""
    contexts = []

    def open_page(text, **settings):
        file = tmp_path / "report.html"
        file.write_text(text, encoding="utf-8")
        context = browser.new_context(viewport={"width": 1200, "height": 900}, **settings)
        contexts.append(context)
        shown, complaints = context.new_page(), []
        shown.on("pageerror", lambda error: complaints.append(str(error)))
        shown.on("console", lambda told: complaints.append(told.text) if bad(told) else None)
        shown.on("request", lambda asked: complaints.append(asked.url) if remote(asked) else None)
        shown.goto(file.as_uri())
        shown.wait_for_selector("html[data-ready]")
        return shown, complaints

    yield open_page
    for context in contexts:
        context.close()


def bad(told):
    return told.type in ("error", "warning")


def remote(asked):
    return not asked.url.startswith(("file:", "data:", "blob:"))


def violations(shown):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    found = axe.Axe().run(shown).response["violations"]
    return [(one["id"], one["nodes"][0]["html"]) for one in found]


def move_slider(shown, time):
    shown.eval_on_selector(
        ".replay input[type=range]",
        "(slider, time) => { slider.value = time; slider.dispatchEvent(new Event('input')); }",
        time,
    )
    stage = shown.locator(".stage").first
    quaternion, axes = (
        json.loads(stage.get_attribute(f"data-{part}")) for part in ("quaternion", "axes")
    )
    return np.array(quaternion), np.array(axes)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_page_has_no_errors_no_requests_and_no_barriers(opened, page, scheme):
    shown, complaints = opened(page, color_scheme=scheme)
    shown.locator("details summary").first.click()
    assert violations(shown) == []
    shown.emulate_media(media="print")
    assert len(shown.pdf()) > 20_000
    assert complaints == []


def test_a_page_prints_alike_from_both_colour_schemes(opened, page):
    light, dark = (len(opened(page, color_scheme=one)[0].pdf()) for one in ("light", "dark"))
    assert light == pytest.approx(dark, rel=1e-3)


def test_the_slider_turns_the_body_as_it_was_saved(opened, page):
    run = run_dataset()
    shown, complaints = opened(page)
    for number in (0, 1, 50, 77, 100):
        quaternion, axes = move_slider(shown, float(run["time"][number]))
        saved = run["quaternion"].values[number]
        np.testing.assert_allclose(quaternion, saved, atol=1e-6)
        dcm = np.asarray(Quaternion(jnp.asarray(saved)).as_dcm().matrix)
        np.testing.assert_allclose(axes, dcm, atol=1e-6)
    assert complaints == []


def test_between_samples_the_body_turns_about_one_axis_at_one_rate(opened, run_file):
    run = run_dataset(3)
    ends = body_about([1.0, -2.0, 0.5], np.array([0.0, 1.9, 0.3]))
    ends[1] *= -1  # the same attitude
    run["quaternion"][:] = ends
    shown, _ = opened(report_page([run_file(run)]))
    for part in (0.25, 0.5, 0.9):
        expected = body_about([1.0, -2.0, 0.5], np.array([1.9 * part]))[0]
        quaternion, _ = move_slider(shown, 5.0 * part)
        np.testing.assert_allclose(quaternion * np.sign(quaternion[0]), expected, atol=1e-6)


def test_failures_are_marked_from_their_time_on(opened, page):
    shown, _ = opened(page)
    told = shown.locator(".told").first
    move_slider(shown, 3.4)
    assert "thruster up" not in told.inner_text()
    assert "thruster 2: failed" in told.inner_text()
    move_slider(shown, 3.5)
    assert "thruster up: dead" in told.inner_text()


def test_playing_advances_the_time_smoothly_and_stops_at_the_end(opened, page):
    shown, complaints = opened(page)
    shown.evaluate(
        """() => {
          window.times = [];
          const slider = document.querySelector(".replay input[type=range]");
          const look = () => {
            times.push([performance.now(), Number(slider.value)]);
            requestAnimationFrame(look);
          };
          requestAnimationFrame(look);
        }"""
    )
    shown.get_by_label("speed").first.select_option("5")
    shown.get_by_role("button", name="Play").first.click()
    shown.wait_for_function("() => times.length && times.at(-1)[1] >= 10")
    shown.get_by_role("button", name="Play").first.wait_for()
    seen = np.array(shown.evaluate("times"))
    moving = (seen[:, 1] > 0) & (seen[:, 1] < 10)
    rate = np.polyfit(seen[moving, 0] / 1000, seen[moving, 1], 1)[0]
    assert rate == pytest.approx(5, rel=0.1)
    assert (np.diff(seen[:, 1]) >= 0).all()
    assert complaints == []


def test_phases_and_numbers_set_the_window_of_all_plots_and_the_cursor_follows(opened, page):
    shown, complaints = opened(page)
    form = shown.locator("form.window").first
    shown.get_by_label("follow").first.select_option("2")
    assert float(form.locator("[name=from]").input_value()) == pytest.approx(5.1)
    assert float(form.locator("[name=to]").input_value()) == pytest.approx(10)
    form.locator("[name=from]").fill("2")
    form.locator("[name=from]").press("Enter")
    ranges = "Bokeh.documents[0].roots().map((one) => [one.x_range.start, one.x_range.end])"
    found = shown.evaluate(f"() => {ranges}")
    assert found.count([2, 10]) == len(found) - 1, "all but the overview"
    form.locator("[name=whole]").click()
    assert shown.evaluate(f"() => {ranges}").count([0, 10]) == len(found)
    move_slider(shown, 7.0)
    cursors = "Bokeh.documents[0].roots().flatMap((one) => one.center.map((two) => two.location))"
    assert shown.evaluate(f"() => {cursors}").count(7) == 1 + len(found) - 1
    assert complaints == []


def test_dragging_across_one_plot_enlarges_all(opened, page):
    shown, complaints = opened(page)
    plot = shown.locator(".plot").nth(2)
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    middle = box["y"] + box["height"] / 2
    shown.mouse.move(box["x"] + box["width"] * 0.4, middle)
    shown.mouse.down()
    shown.mouse.move(box["x"] + box["width"] * 0.6, middle, steps=8)
    shown.mouse.up()
    shown.wait_for_function("() => Bokeh.documents[0].roots()[1].x_range.start > 1")
    ranges = shown.evaluate(
        "() => Bokeh.documents[0].roots().slice(1).map((one) => one.x_range.end)"
    )
    assert len(set(ranges)) == 1
    assert ranges[0] < 9
    assert complaints == []


def test_tables_sort_by_number_and_by_name_with_the_keyboard(opened, page):
    shown, _ = opened(page)
    numbers = shown.locator("table.sortable").last
    head = numbers.locator("th").nth(3)
    head.locator("button").press("Enter")
    values = [float(text) for text in numbers.locator("td:nth-child(4)").all_inner_texts()]
    assert values == sorted(values)
    assert head.get_attribute("aria-sort") == "ascending"
    head.locator("button").press("Enter")
    values = [float(text) for text in numbers.locator("td:nth-child(4)").all_inner_texts()]
    assert values == sorted(values, reverse=True)


def test_hover_tells_the_value_with_its_unit(opened, page):
    shown, _ = opened(page)
    plot = shown.locator("figure", has_text="Angular velocity").locator(".plot")
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    shown.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    shown.mouse.move(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2)
    tip = shown.locator(".bk-Tooltip")
    tip.get_by_text("rad/s").first.wait_for()
