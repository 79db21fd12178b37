"""Software in the loop: a loop whose law and estimator are the compiled C of an export.

Compiled loops call it once a period for all cases of a batch. Allocation, modulation and the
simulated plant stay as they are; parameters and memories are those of the case.
"""

import ctypes
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.compiler.c.layout import Struct
from jaxsat.control.navigation.estimator import AbstractEstimator, Estimate, Measurement
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import IntScalar, RealScalar
from jaxsat.core.attitude import Quaternion
from jaxsat.core.errors import LibraryError
from jaxsat.core.once import once
from jaxsat.flight.calls import unpacked
from jaxsat.flight.flight import CannotExport, FlightController, Seen
from jaxsat.flight.harness import ABI
from jaxsat.flight.measurements import measured_by, vector_names
from jaxsat.flight.program import FlightProgram, flight_program, is_parameter
from jaxsat.flight.reference import rows_of
from jaxsat.flight.vectors import with_law
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum

SHA256_DIGITS = 64


class Library:
    """The compiled stages of a controller, for rows of numbers; each row is a case.

    A store keeps `identity`: the ABI version, the precision, and SHA-256 digests of the C text, of
    the compiled parameters and of the binary. The library flies any parameters and any plant: every
    call passes the parameters of its cases. Raises `LibraryError` for a file that is no library of
    this ABI version, or that of another controller, and for a loop without flight code.
    """

    def __init__(self, path: Path, loop: AbstractLoop, start: PlantState):
        self.path = path.resolve()
        try:
            self._library, binary = _loaded(self.path)
            identity = self._library.controller_identity
            defaults = self._library.controller_defaults
        except (OSError, AttributeError) as error:
            raise LibraryError(
                f"must be a library that `make` built of an export of this version of jaxsat "
                f"({error})"
            ) from None
        identity.restype = ctypes.c_char_p
        if binary != _sha256(self.path.read_bytes()):
            raise LibraryError(
                "was built again since this process loaded it; start another process"
            )
        abi, program, precision, source = identity().decode().split(" ")
        if abi != str(ABI):
            raise LibraryError(f"must have ABI version {ABI}, got {abi}; export it again")
        if len(source) != SHA256_DIGITS:
            raise LibraryError(
                "must contain the SHA-256 of controller.h and controller.c, got none; "
                "build it again where sha256sum or shasum is installed"
            )
        self.single = precision == "single"
        try:
            self.program: FlightProgram = flight_program(loop, start, single=self.single)
        except CannotExport as error:
            raise LibraryError(
                f"must be left out, the scenario has no flight code: {error}"
            ) from None
        if program != self.program.hash:
            raise LibraryError(
                f"must be made of this scenario's controller, whose program is "
                f"{self.program.hash[:12]}, got one of {program[:12]}; export it again"
            )
        row = np.zeros(self.program.structs["parameters"].size)
        defaults.argtypes, defaults.restype = [ctypes.c_void_p], None
        defaults(row.ctypes.data)
        self.identity: dict[str, Any] = {
            "abi": ABI,
            "precision": precision,
            "source_sha256": source,
            "parameters_sha256": _sha256(row.astype("<f8").tobytes()),
            "binary_sha256": binary,
        }
        paths = jax.tree_util.tree_leaves_with_path(
            eqx.filter(FlightController.of(loop), is_parameter)
        )
        self.leaves = {
            part: [i for i, (path, _) in enumerate(paths) if getattr(path[0], "name", "") == part]
            for part in ("law", "estimator")
        }

    def run(self, stage: str, rows: list[Any], out: Struct) -> tuple[np.ndarray, np.ndarray]:
        """Return outputs and next states of a stage for rows of parameters, inputs and states."""
        arguments = np.ascontiguousarray(np.concatenate(rows, axis=1), np.float64)
        count, sizes = len(arguments), (out.size, self.program.structs["state"].size)
        outcomes = np.zeros((count, sum(sizes)))
        function = getattr(self._library, f"controller_{stage}_batch")
        function.argtypes = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
        function.restype = None
        function(count, arguments.ctypes.data, outcomes.ctypes.data)
        return outcomes[:, : sizes[0]], outcomes[:, sizes[0] :]


@once
def _loaded(path: Path) -> tuple[ctypes.CDLL, str]:
    """Load a library once per process; return it with the digest of its file."""
    return ctypes.CDLL(str(path)), _sha256(path.read_bytes())


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def with_library(loop: SampledLoop, library: Library) -> SampledLoop:
    """Return the loop with the library in place of its law and any estimator."""
    law = ExternalLaw(law=loop.controller, period=loop.controller.period, library=library)
    return with_law(loop, law, lambda one: ExternalEstimator(estimator=one, library=library))


class ExternalLaw(AbstractSampledController):
    """A law with the library's step; other queries of its memory go to the law itself."""

    law: AbstractSampledController
    period: RealScalar
    library: Library = eqx.field(static=True)

    def init(self, state: PlantState) -> PyTree:
        """Return the memory before the first sample, by the law itself."""
        return self.law.init(state)

    def step(self, t: Array, state: PlantState, memory: PyTree) -> tuple[Array, PyTree]:
        """Return the library's torque (N m) and memory."""
        arrays = eqx.filter(self.law, is_parameter)
        sample = jnp.asarray(jnp.round(t / self.period), jnp.int32)
        command = jax.eval_shape(self.law.step, t, state, memory)[0]
        law_input = Seen(state.attitude, state.omega, wheel_momentum(state))
        call = _Call(self.library, "control")
        return jax.pure_callback(
            call, (command, memory), arrays, sample, law_input, memory, vmap_method="broadcast_all"
        )

    def rate_error(self, state: PlantState, memory: PyTree) -> Float[Array, "2"]:
        """Return the distance of the rates from the law's own reference, rad/s."""
        return self.law.rate_error(state, memory)

    def judged(self, memory: PyTree) -> PyTree:
        """Return the part of the memory that must stay finite."""
        return self.law.judged(memory)

    def telemetry(self, memory: PyTree) -> Mapping[str, Array]:
        """Return the law's own telemetry, by signal."""
        return self.law.telemetry(memory)

    def mode(self, memory: PyTree) -> IntScalar:
        """Return the active part of the law."""
        return self.law.mode(memory)


class ExternalEstimator(AbstractEstimator):
    """An estimator with the library's step; it estimates attitude and rate alone."""

    estimator: AbstractEstimator
    library: Library = eqx.field(static=True)

    def init(self, attitude: Quaternion, sigma: Array) -> PyTree:
        """Return the memory before the first sample, by the estimator itself."""
        return self.estimator.init(attitude, sigma)

    def step(
        self, sample: Array, period: Array, measurement: Measurement, memory: PyTree
    ) -> tuple[Estimate, PyTree]:
        """Return the library's estimate and memory."""
        arrays = eqx.filter(self.estimator, is_parameter)
        momentum = self.library.program.now.measured.wheel_momentum
        if momentum is not None:  # which the estimator does not use, and `ExternalLaw` receives
            momentum = jnp.zeros(momentum.shape)
        like, rate = self.library.program.now.measured, cast(Array, measurement.rate)
        measured = measured_by(measurement, vector_names(like), momentum)
        law_input = Seen(Quaternion(jnp.zeros(4, rate.dtype)), rate, momentum)
        call = _Call(self.library, "estimate")
        law_input, memory = jax.pure_callback(
            call, (law_input, memory), arrays, sample, measured, memory, vmap_method="broadcast_all"
        )
        return Estimate(law_input.attitude, law_input.omega), memory


class _Call:
    """Callback of one stage for arrays of cases, for compiled loops."""

    def __init__(self, library: Library, stage: str):
        self.library, self.stage = library, stage

    def __call__(self, arrays: PyTree, sample: Any, inputs: PyTree, memory: PyTree) -> PyTree:
        """Return the stage's results for all cases; unused numbers of rows are zero."""
        program, controls = self.library.program, self.stage == "control"
        part = "law" if controls else "estimator"
        sample = np.asarray(sample)
        count = max(1, sample.size)
        structs = program.structs
        rows = [self._parameters(part, arrays, count)]
        input_rows = rows_of((sample, inputs), count)
        if controls and program.estimates:
            empty = np.zeros((count, structs["input"].size - 1))
            rows += [input_rows[:, :1], empty, input_rows[:, 1:]]
        else:
            rows.append(input_rows)
        before = np.zeros((count, structs["state"].size))
        place = _places(program, part)
        before[:, place] = rows_of(memory, count)
        rows.append(before)
        out = structs["output"] if controls else structs["seen"]
        output_rows, after = self.library.run(self.stage, rows, out)
        if controls:
            first = structs["output"].fields[0]
            outputs: Any = output_rows[:, : first.size].reshape(*sample.shape, -1)
            outputs = outputs.astype(jax.dtypes.canonicalize_dtype(float))
        else:
            q = np.zeros((*inputs.rate.shape[:-1], 4), inputs.rate.dtype)
            like = Seen(Quaternion(q), inputs.rate, inputs.wheel_momentum)
            outputs = unpacked(output_rows, like, sample.shape)
        return outputs, unpacked(after[:, place], memory, sample.shape)

    def _parameters(self, part: str, arrays: PyTree, count: int) -> np.ndarray:
        """Return the case's own arrays, and the scenario's for all others."""
        program = self.library.program
        own = {
            program.order[place]: leaf
            for place, leaf in reversed(
                list(zip(self.library.leaves[part], jax.tree.leaves(arrays), strict=True))
            )
        }
        columns = []
        for field in program.structs["parameters"].fields:
            value = np.asarray(own.get(field.number, program.parameters[field.number]), float)
            columns.append(np.broadcast_to(value.reshape(-1, field.size), (count, field.size)))
        return np.concatenate(columns, axis=1) if columns else np.zeros((count, 0))


def _places(program: FlightProgram, part: str) -> np.ndarray:
    """Return the indices of a part's numbers in a state."""
    places, place = [], 0
    for field in program.structs["state"].fields:
        if field.path == part or field.path.startswith((f"{part}.", f"{part}[")):
            places += range(place, place + field.size)
        place += field.size
    return np.array(places, int)
