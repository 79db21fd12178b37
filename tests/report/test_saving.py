"""Figures that fail lose nothing but themselves."""

import io
import re
import subprocess
import sys
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from jaxsat.report.png_and_svg import png_and_svg
from jaxsat.report.saving import save_figures


def figure(text="plain"):
    made = Figure(figsize=(1, 1))
    made.suptitle(text, parse_math=text != "plain")
    return made


def test_one_that_fails_is_told_and_the_rest_is_written():
    written = {}
    figures = {"one": figure(), "two": figure("$\\nonsense$"), "three": lambda: 1 / 0}
    with pytest.warns(RuntimeWarning) as told:
        save_figures(figures, written.__setitem__)
    assert set(written) == {"one.png", "one.svg"}
    assert [str(one.message)[:22] for one in told] == [
        "figure two: not drawn,",
        "figure three: not draw",
    ]
    assert "ZeroDivisionError: division by zero" in str(told[1].message)


def test_all_that_fail_are_told():
    def make():
        raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")

    with pytest.warns(RuntimeWarning, match="figures: not drawn, UnicodeDecodeError"):
        save_figures(make, lambda *_: pytest.fail("nothing is there"))


def test_settings_of_a_user_have_no_part():
    """Not even those that fail, such as TeX where there is none."""
    plain, odd = {}, {}
    save_figures(lambda: {"one": figure()}, plain.__setitem__)
    with mpl.rc_context({"text.usetex": True, "savefig.format": "pdf", "axes.facecolor": "red"}):
        save_figures(lambda: {"one": figure()}, odd.__setitem__)
    assert odd == plain


def test_what_cannot_be_written_is_raised():
    def write(name, content):
        raise OSError("no room")

    with pytest.raises(OSError, match="no room"):
        save_figures({"one": figure()}, write)


def everything() -> Figure:
    """A figure with all that a renderer can be given, but text."""
    drawn = Figure(figsize=(3.3, 2.1), dpi=130)
    axes = drawn.add_axes((0.1, 0.1, 0.8, 0.8))
    x = np.linspace(0, 1, 7)
    axes.plot(x, x**2, "o--")
    axes.fill_between(x, x, x**3, alpha=0.3)
    axes.scatter(x, x, c=x, s=20 * x)
    axes.pcolormesh(x, x[:3], np.outer(x[:2], x[:6]), rasterized=True)
    axes.pcolormesh(x, x[2:5], np.outer(x[:2], x[:6]))
    axes.imshow(np.outer(x, x), extent=(0.2, 0.4, 0.6, 0.8))
    axes.tripcolor(x, x**2, x, shading="gouraud", rasterized=True)
    axes.tripcolor(x, 1 - x**2, x, shading="gouraud")
    axes.add_patch(Circle((0.5, 0.5), 0.2, fill=False, hatch="//"))
    axes.lines[0].set_clip_path(Circle((0.5, 0.5), 0.3, transform=axes.transData))
    axes.set_axis_off()
    return drawn


@mpl.rc_context({"svg.hashsalt": "jaxsat"})  # names in SVG are random otherwise
def test_one_drawing_gives_the_files_that_matplotlib_draws_apart():
    png, svg = png_and_svg(everything())
    with io.BytesIO() as file:
        FigureCanvasAgg(everything()).print_png(file)
        with Image.open(io.BytesIO(png)) as drawn_once, Image.open(file) as drawn_apart:
            np.testing.assert_array_equal(np.asarray(drawn_once), np.asarray(drawn_apart))
            assert drawn_once.info["dpi"] == pytest.approx(drawn_apart.info["dpi"])
    with io.StringIO() as file:
        FigureCanvasSVG(everything()).print_svg(file, metadata={"Date": None})
        apart = ElementTree.fromstring(file.getvalue())
    once = ElementTree.fromstring(svg)
    for one, other in zip(once.iter(), apart.iter(), strict=True):
        assert one.tag == other.tag
        assert one.get("style") == other.get("style")
        for name in ("d", "x", "y", "width", "height"):
            places, expected = (
                [float(number) for number in re.findall(r"-?\d+\.?\d*", each.get(name, ""))]
                for each in (one, other)
            )
            np.testing.assert_allclose(places, expected, atol=2e-2)


def texts() -> Figure:
    """A figure whose texts share letters, and differ in size, weight and direction."""
    drawn = Figure(figsize=(3, 2))
    drawn.suptitle("One and two", weight="bold")
    axes = drawn.add_subplot()
    axes.set_xlabel("two")
    axes.set_ylabel("two", size=14)
    axes.text(0.2, 0.5, "one² & <two>")
    return drawn


def test_letters_are_where_matplotlib_puts_them():
    """Its own have hints, so rows and columns of pixels are compared by their mean places."""
    with io.BytesIO() as file:
        FigureCanvasAgg(texts()).print_png(file)
        images = [
            Image.open(one).convert("L") for one in (io.BytesIO(png_and_svg(texts())[0]), file)
        ]
    ink, expected = (255.0 - np.asarray(image) for image in images)
    assert ink.sum() == pytest.approx(expected.sum(), rel=0.05)
    for axis in (0, 1):
        (place, other), (spread, other_spread) = zip(
            *(_moments(one.sum(axis=axis)) for one in (ink, expected)), strict=True
        )
        assert place == pytest.approx(other, abs=1)
        assert spread == pytest.approx(other_spread, abs=1)


def _moments(ink: np.ndarray) -> tuple[float, float]:
    """The mean place of ink, and its standard deviation."""
    places = np.arange(len(ink))
    mean = np.average(places, weights=ink)
    return mean, np.sqrt(np.average((places - mean) ** 2, weights=ink))


@mpl.rc_context({"svg.hashsalt": "jaxsat"})
def test_texts_are_those_of_matplotlib_also_when_they_are_known():
    with io.StringIO() as file:
        FigureCanvasSVG(texts()).print_svg(file, metadata={"Date": None})
        apart = ElementTree.fromstring(file.getvalue())
    first, second = png_and_svg(texts()), png_and_svg(texts())
    assert first == second
    drawn = ElementTree.fromstring(second[1])
    link = "{http://www.w3.org/1999/xlink}href"
    for one, other in zip(drawn.iter(), apart.iter(), strict=True):
        assert (one.tag, one.get(link)) == (other.tag, other.get(link))
        if one.tag.endswith("use"):
            assert one.get("transform") == other.get("transform")


DRAWS = """
from jaxsat.report.saving import undocumented
with undocumented():
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
from matplotlib.artist import Artist, kwdoc
line = Line2D([0, 1], [0, 1])
line.set(linewidth=3)
figure = Figure()
figure.add_subplot().add_line(line)
figure.canvas.draw()
class Documented(Artist):
    pass
print(line.get_linewidth(), Line2D.set.__doc__)
print("alpha" in Documented.set.__doc__, len(kwdoc(line)) > 100)
"""


def test_matplotlib_draws_where_it_is_imported_without_its_docstrings():
    command = [sys.executable, "-c", DRAWS]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "3.0 None\nTrue True\n"
