"""The unit (FMU) of a controller, by FMPy: valid, and flown with the bits of the controller."""

import io
import zipfile
from functools import cache

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.fmu import HEADERS, SOURCES, unit_file, unit_period, unit_sources
from jaxsat.flight.interface import parameters, rows
from jaxsat.flight.program import flight_program
from jaxsat.flight.reference import Reference
from jaxsat.flight.vectors import recorded_flight
from tests.flight.controllers import TRACKER, estimating, few_samples, filtered, sources

fmpy = pytest.importorskip("fmpy")


@pytest.fixture(scope="module", autouse=True)
def _few_samples():
    with few_samples():
        yield


def _estimating():
    return estimating(TRACKER, "control.period_s=0.02")


@cache
def made(make, single=False):
    """The unit of a controller, its program, and a recorded flight."""
    loop, first, keys = make()
    program = flight_program(loop, first, single=single)
    table = parameters(program, loop, keys)
    own = unit_sources(program, rows(program, table), table, [], 10, "A <title> & more")
    unit, missing = unit_file(
        own, {name: text.encode() for name, text in sources(program, table).items()}
    )
    assert missing == ""
    reference = Reference(program)
    inputs = vectors.vectors(program, loop, first, 100.0, reference=reference)[1]
    return unit, program, recorded_flight(reference, inputs)


@pytest.fixture
def unit(tmp_path, request):
    """The file of a unit, the model description that FMPy reads, program and recorded flight."""
    content, program, recording = made(*request.param)
    (tmp_path / "controller.fmu").write_bytes(content)
    path = str(tmp_path / "controller.fmu")
    return path, fmpy.read_model_description(path, validate=True), program, recording


def parts_of(program, recording):
    """Inputs and outputs of a recorded flight by their names, an array of each."""
    place, parts = 0, {}
    for struct in ("input", "output"):
        for field in program.structs[struct].fields:
            values = recording[:, place : place + field.size]
            parts[struct, field.name] = values.reshape(-1, *field.shape)
            place += field.size
    return parts


BOTH = [(filtered,), pytest.param((_estimating, True), marks=pytest.mark.slow)]


@needs("gcc")
@pytest.mark.parametrize("unit", BOTH, indirect=True)
def test_a_unit_flies_with_the_bits_of_the_controller(unit):
    path, description, program, recording = unit
    assert fmpy.validation.validate_fmu(path) == []
    parts, period = parts_of(program, recording), unit_period(program)
    places = {one.name: one.valueReference for one in description.modelVariables}
    one = instance(path, description)
    try:
        one.enterInitializationMode(startTime=0.0)
        one.exitInitializationMode()
        for sample in range(len(recording)):
            for field in program.structs["input"].fields:
                if field.path != "sample":
                    put(one, references(places, field), field, parts["input", field.name][sample])
            one.doStep(sample * period, period)
            for field in program.structs["output"].fields:
                found = get(one, references(places, field), field)
                expected = np.ravel(parts["output", field.name][sample])
                np.testing.assert_array_equal(found, expected, err_msg=f"{field.name} {sample}")
            assert one.getInt32([places["sample"]]) == [sample]
            assert one.getUInt32([places["status"]]) == [0]
        one.terminate()
    finally:
        one.freeInstance()


def instance(path, description):
    one = fmpy.fmi3.FMU3Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path, path.removesuffix(".fmu")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="controller",
    )
    one.instantiate()
    return one


def references(places, field):
    """The value references of a field's elements."""
    indices = [",".join(str(i + 1) for i in index) for index in np.ndindex(field.shape)]
    return [places[f"{field.name}[{index}]" if index else field.name] for index in indices]


def put(one, places, field, value):
    numbers = np.ravel(value)
    if field.dtype.kind == "b":
        one.setBoolean(places, [bool(x) for x in numbers])
    else:
        set_floats = one.setFloat32 if field.dtype == np.float32 else one.setFloat64
        set_floats(places, list(numbers))


def get(one, places, field):
    kinds = {"int32": one.getInt32, "bool": one.getBoolean, "float32": one.getFloat32}
    return kinds.get(str(field.dtype), one.getFloat64)(places)


@needs("gcc")
@pytest.mark.parametrize("unit", BOTH[:1], indirect=True)
def test_a_unit_has_names_units_and_sizes(unit):
    _, description, program, _ = unit
    assert description.modelName == "A <title> & more"
    assert description.fmiVersion == "3.0"
    assert description.instantiationToken == program.hash
    by_name = {one.name: one for one in description.modelVariables}
    rate, gain, torque = (by_name[name] for name in ("omega[3]", "law_gain[2]", "torque[1]"))
    assert (rate.causality, rate.unit, rate.start) == ("input", "rad/s", "0.0")
    assert (gain.causality, gain.unit, gain.start) == ("parameter", "N m s", "2.0")
    assert (torque.causality, torque.unit) == ("output", "N m")
    units = {one.name: one.baseUnit for one in description.unitDefinitions}
    newton_metre = units["N m s"]
    assert (newton_metre.kg, newton_metre.m, newton_metre.s) == (1, 2, -1)


@needs("gcc")
@pytest.mark.parametrize("unit", BOTH[:1], indirect=True)
def test_fmpy_simulates_it(unit):
    """Parts of a period make no sample; a longer step makes those within it."""
    path, _, program, _ = unit
    period = unit_period(program)
    inputs = np.array([(0.0, 0.01)], [("time", float), ("omega[1]", float)])
    for ratio in (0.25, 1.0, 3.0):
        result = fmpy.simulate_fmu(
            path, stop_time=12 * period, step_size=ratio * period, output_interval=ratio * period,
            input=inputs, output=["sample", "status"],
        )  # fmt: skip
        last = [round(time / period + 0.499999) - 1 for time in result["time"][1:]]
        assert list(result["sample"][1:]) == last
        assert set(result["status"]) == {0}


@needs("gcc")
@pytest.mark.parametrize("unit", BOTH[:1], indirect=True)
def test_a_parameter_out_of_its_range_is_refused(unit):
    path, description, _, _ = unit
    places = {one.name: one.valueReference for one in description.modelVariables}
    one = instance(path, description)
    try:
        one.enterInitializationMode(startTime=0.0)
        one.setFloat64([places["law_gain[1]"]], [51.0])
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.exitInitializationMode()
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.setFloat64([places["torque[1]"]], [1.0])  # an output
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.getFloat64([len(places) + 1])
    finally:
        one.freeInstance()


def test_without_a_compiler_a_unit_has_sources_alone(monkeypatch):
    monkeypatch.setattr("jaxsat.flight.fmu.shutil.which", lambda tool: None)
    own = {f"sources/{name}": "" for name in SOURCES}
    unit, missing = unit_file(own, dict.fromkeys(HEADERS, b""))
    assert missing == "no C compiler (cc) is installed"
    names = zipfile.ZipFile(io.BytesIO(unit)).namelist()
    assert sorted(names) == sorted(f"sources/{name}" for name in (*SOURCES, *HEADERS))
