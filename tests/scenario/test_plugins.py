"""Laws that do not come with jaxsat: from a module beside the scenario and from a package."""

import shutil
import sys

import numpy as np
import pytest

from jaxsat.core import process
from jaxsat.scenario import ScenarioError, dump, plugins
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.store.ledger import study_columns
from jaxsat.studies.executors import Serial
from jaxsat.studies.processes import Processes
from jaxsat.studies.run import run_study
from scenario.own_law import LAW, SCENARIO
from scenario.packages import PACKAGE, forget_package, install_package


@pytest.fixture(autouse=True)
def _nothing_stays(monkeypatch):
    """No module or folder of a test is there in the next."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    plugins.installed.cache_clear()
    yield
    sys.modules.pop("own_law", None)
    plugins.installed.cache_clear()


@pytest.fixture
def own(tmp_path):
    """A scenario with its law beside it."""
    (tmp_path / "own_law.py").write_text(LAW, encoding="utf-8")
    (tmp_path / "own.toml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path / "own.toml"


def refused(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides, purpose="study")
    return str(caught.value)


@pytest.mark.slow
def test_a_law_beside_the_scenario_is_simulated_and_written_out_again(own):
    scenario = load(own, ["simulation.duration_s=60"], purpose="study")
    run = build(scenario)
    trajectory = run.simulate()
    assert run.loop.plant.effectors[0].thrust_map.shape == (3, 3)
    assert np.abs(np.asarray(trajectory.signals.omega)[-1]).max() < 1e-6
    copy = own.with_name("copy.toml")
    copy.write_text(dump(scenario), encoding="utf-8")
    assert load(copy) == scenario


@pytest.mark.parametrize(
    ("override", "key", "message"),
    [
        ("control.kd=-1", "control.kd", "must be greater than 0 N m s, got -1"),
        ("control.kdd=1", "control.kdd", "did you mean kd?"),
        ("control.bias_N_m=[1,2]", "control.bias_N_m", "must have 3 entries in N m"),
        ("control.frame=body", "control.frame", 'one of "orbit", "inertial", got "body"'),
        ("control.kp=4", "control.kd", "must be at least kp = 4.0, got 3.0"),
        ("control.model.orbit_rat=1", "control.model.orbit_rat", "did you mean orbit_rate_rad_s?"),
        ("spacecraft.failed_thrusters=[3]", "failed_thrusters", "body axes x, y and z"),
        ("tuning.parameters.kp={low=2,high=1}", "tuning.parameters.kp.high", "above low = 2"),
        ("tuning.parameters.k={low=2,high=3}", "tuning.parameters.k", "must be one of kp, kd"),
        ("tuning.smoothing.kd=1", "tuning.smoothing.kd", "must be left out under the law"),
        ("control.law=own_law:QD", "control.law", "must name a class of own_law"),
        ("control.law=own_law:not_a_class", "control.law", "must name a class of own_law"),
        ("control.law=own_law:Rule", "control.law", "a subclass of AbstractController or"),
        ("control.law=own_law:Abstract", "control.law", "must name a law with __call__"),
        ("control.law=own_law:NoDeclaration", "control.law", "that is a LawDeclaration"),
        ("control.law=own-law:PD", "control.law", 'the form "module:Class"'),
        ("control.law=no_such_law:PD", "control.law", "there is no module no_such_law beside"),
        (
            "control.law=own_law:Unbuildable",
            "control.law",
            "KeyError: 'kq'; the declared keys are kp, kd",
        ),
        ("control.law=own_law:Other", "control.law", "gives the law, got int"),
        ("control.law=own_law:Pd", "control.law", "did you mean PD?"),
        ("control.law=own_law:TwoTorques", "control.law", "commands an array of shape (3,) ("),
        ("control.law=own_law:WithText", "control.law", "equinox.field(static=True)"),
        ("control.law=own_law:NoSuchGain", "control.law", "has an attribute `gain_p`"),
        (
            "control.law=own_law:RateErrorIsANumber",
            "control.law",
            "of shape (2,) from `rate_error`",
        ),
        ("control.law=own_law:LyapunovIsAVector", "control.law", "of shape () from `lyapunov`"),
        ("control.law=own_law:Branches", "control.law", "use jnp.where in place of `if`"),
        ("control.law=own_law:NoMemoryRate", "control.law", "and the rate of its memory, got one"),
        ("control.law=own_law:OtherMemory", "control.law", "got float64 (3,) from `init`"),
        ("control.law=own_law:Broken", "control.law", "own_law.py:"),
        ("control.law=own_law:BrokenRule", "control.law", "rule over control.kd can run, got Typ"),
    ],
)
def test_every_mistake_is_one_message_at_its_key(own, override, key, message):
    found = refused(own, override)
    assert message in found, found
    assert f"key {key}" in found or f".{key}" in found
    assert len(found.splitlines()) == 1


@pytest.mark.slow
def test_a_law_with_a_memory_needs_no_more_than_its_torque(own):
    run = build(load(own, ["control.law=own_law:Integral", "simulation.duration_s=1"]))
    assert run.loop.is_smooth()
    assert np.isnan(np.asarray(run.simulate().signals.lyapunov)).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = ", "SyntaxError"),
        ("\n1 / 0", "ZeroDivisionError: division by zero ("),
        ("import no_such_thing", "ModuleNotFoundError: No module named 'no_such_thing'"),
        ("import jaxsat.declaration", "; it is jaxsat.core.declaration now"),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_with_its_line(own, text, message):
    own.with_name("own_law.py").write_text(text, encoding="utf-8")
    found = refused(own)
    assert message in found
    assert "own_law.py" in found
    assert f"{own}:12: key control.law: must name a module that can be imported" in found


def test_a_module_that_cannot_be_imported_is_imported_once_a_reading(own, capsys):
    text = 'print("once")\nraise SystemExit(3)'
    own.with_name("own_law.py").write_text(text, encoding="utf-8")
    assert "SystemExit: 3 (" in refused(own)
    assert capsys.readouterr().out == "once\n"
    assert "SystemExit: 3 (" in refused(own)  # it may have been mended meanwhile
    assert capsys.readouterr().out == "once\n"


def test_a_module_that_another_hides_is_refused(own, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(own.with_name("own_law.py"), other)
    shutil.copy(own, other)
    load(own)
    assert "must name a module that no other hides" in refused(other / "own.toml")


def test_an_override_takes_the_other_laws_gains_away(own):
    own.write_text(SCENARIO[: SCENARIO.index("[tuning]")], encoding="utf-8")
    assert load(own, ["control.law=coast"]).control.law == "coast"
    text = own.read_text(encoding="utf-8").replace("own_law:PD", "rate").replace("kp", "k1")
    own.write_text(text.replace("kd", "k2"), encoding="utf-8")
    changed = load(own, ["control.law=own_law:PD", "control.kp=1", "control.kd=2"])
    assert changed.control.law == "own_law:PD"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    install_package(tmp_path / "site", monkeypatch)
    yield PACKAGE / "reduced-effort.toml"
    forget_package()


TWO_WHEELS = ["wheel=[{axis=[1.0,0.0,0.0],momentum_limit_N_m_s=9.0},{axis=[0.0,1.0,0.0]}]"]


@pytest.mark.slow
@pytest.mark.parametrize("actuators", [[], TWO_WHEELS], ids=["torques", "wheels"])
def test_the_law_of_a_package_flies_as_published(installed, actuators):
    """Tsiotras and Luo (Automatica 36, 2000), section 5: the numbers of an own simulation.

    Two wheels without momentum in all turn the body as two torques do where it does not spin; the
    thrusters of the file are then never used, which is told.
    """
    cautions: list[str] = []
    trajectory = build(load(installed, actuators, caution=cautions.append)).simulate()
    assert ["never used" in one for one in cautions] == [True for _ in actuators]
    signals, times = trajectory.signals, np.asarray(trajectory.times)
    tilt = np.hypot(*np.asarray(signals.w).T)
    turn, torque = np.asarray(signals.z), np.abs(np.asarray(signals.torque))
    outside = np.flatnonzero((tilt >= 0.05) | (np.abs(turn) >= 0.05))
    assert np.asarray(signals.w)[0] == pytest.approx([-0.05882, -0.23529], abs=5e-6)
    assert turn[0] == pytest.approx(2.06075, abs=5e-6)
    assert times[outside[-1]] == pytest.approx(88.0)
    assert torque.max() == pytest.approx(0.58675, abs=1e-5)
    assert torque[:-1].sum() * 0.05 == pytest.approx(3.4994, abs=5e-5)
    assert tilt[-1] == pytest.approx(0.012214, abs=5e-7)
    assert turn[-1] == pytest.approx(1.75e-9, abs=5e-12)


def test_the_law_of_a_package_has_its_name_in_messages(installed):
    assert '"reduced-effort"' in refused(installed, "control.law=reduced_effort")
    assert "must be given in 1/s" in refused("paper-rate", "control.law=reduced-effort")
    assert "independent torques" in refused(installed, "spacecraft.failed_thrusters=[1]")
    upside_down = "initial.quaternion=[0, 1, 0, 0]"
    assert "must not be upside down" in refused(installed, upside_down)


def test_what_has_no_native_rule_is_named_with_its_place_and_runs_on_scan(own):
    scenario = load(own, ["control.law=own_law:Linear"])
    made = study(scenario, "auto")
    line = next(n for n, text in enumerate(LAW.split("\n"), 1) if "linalg.eigvalsh" in text)
    assert type(made.engine).__name__ == "ScanEngine"
    assert f"own_law.py:{line}" in made.remark


def study(scenario, engine, count=6):
    return build_study(scenario, count, engine=engine, batch_size=4, chunk=3)


def columns(made, target, executor=None):
    run_study(made, target, executor=executor or Serial())
    found = study_columns(target)
    return {name: np.asarray(found[name]) for name in ("cost", "effort")}


@pytest.mark.slow
def test_worker_processes_find_the_module(own, tmp_path):
    """Every engine: tests/cli/test_plugin_package.py."""
    made = study(load(own, purpose="study"), "native")
    here = columns(made, tmp_path / "here.zarr")
    there = columns(made, tmp_path / "there.zarr", Processes(2))
    np.testing.assert_array_equal(here["cost"], there["cost"])
