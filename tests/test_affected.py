"""The choice of tests that a change can affect, on the package as it stands."""

import pytest

from affected import ROOT, Selection


@pytest.fixture(scope="module")
def selection():
    return Selection()


@pytest.mark.parametrize(
    ("changed", "chosen", "left"),
    [
        ("jaxsat/core/quotients.py", "tests/control/test_estimators.py", "tests/test_affected.py"),
        (
            "jaxsat/report/page/html.py",
            "tests/cli/test_report.py",
            "tests/control/test_rate.py",
        ),
        (
            "tests/helpers/pages.py",
            "tests/report/page/test_run_page.py",
            "tests/spacecraft/test_dynamics.py",
        ),
        ("tests/oracle/rate_law.py", "tests/control/test_rate.py", "tests/core/test_noise.py"),
        ("docs/sensors.md", "tests/cli/test_your_own_estimator.py", "tests/core/test_noise.py"),
        (
            "jaxsat/scenario/library/failures-telescope.toml",
            "tests/scenario/test_library.py",
            "tests/control/test_rate.py",
        ),
    ],
)
def test_what_depends_on_a_change_is_chosen_and_the_rest_is_not(selection, changed, chosen, left):
    tests = selection.tests([changed])
    assert chosen in tests
    assert left not in tests
    assert (ROOT / left).is_file()


def test_the_mirror_of_a_module_comes_first(selection):
    assert selection.tests(["jaxsat/core/quotients.py"])[0] == "tests/core/test_quotients.py"


def test_fewer_imports_choose_fewer_tests(selection):
    near, far = (set(selection.tests(["jaxsat/core/allocation.py"], within)) for within in (1, 99))
    assert near < far


def test_what_everything_depends_on_chooses_everything(selection):
    every = {p.relative_to(ROOT).as_posix() for p in ROOT.glob("tests/**/test_*.py")}
    assert set(selection.tests(["tests/conftest.py"])) == every


def test_notebooks_and_pages_that_use_a_module_are_told(selection):
    assert "notebooks/controllability.ipynb" in selection.notebooks(
        ["jaxsat/controllability/cone.py"]
    )
    assert "notebooks/tuning.ipynb" in selection.notebooks(["notebooks/tuning.ipynb"])
    assert "docs/architecture.md" in selection.pages(["jaxsat/spacecraft/dynamics.py"])
