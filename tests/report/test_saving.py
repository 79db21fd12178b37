"""Figures that fail lose nothing but themselves."""

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

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
