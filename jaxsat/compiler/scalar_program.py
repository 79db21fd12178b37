"""Programs of scalars of any function of `jax.numpy`, for printers other than LLVM's.

There is one case: every value is uniform, branches are taken or not, and elementary functions are
called, not inlined. Values have source frames.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler import rules
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, Value
from jaxsat.compiler.lowering import arrays_of, bugs_in, lower, number_type, scalars_of
from jaxsat.compiler.passes.branching import with_branches
from jaxsat.compiler.passes.dead_code import without_dead_code
from jaxsat.compiler.passes.outlining import outlined
from jaxsat.compiler.trace import Trace
from jaxsat.core.jaxprs import Jaxpr, jaxpr_and_shapes

del rules  # imported for the table it fills


@dataclass(frozen=True)
class ScalarProgram:
    """Operations of a function, with one parameter and one result for each element of its arrays.

    `trace` has the source frames of values, and the arrays that they belong to.
    """

    jaxpr: Jaxpr
    function: Function
    trace: Trace
    outputs: PyTree


def scalar_program(name: str, function: Callable, examples: Sequence[PyTree]) -> ScalarProgram:
    """Return the program of a function of trees like these; `outputs` has its results' shapes.

    Raises `CannotLower` for an operation without rule.
    """
    jaxpr, outputs = jaxpr_and_shapes(function, *examples)
    params: list[Value] = []
    arrays = []
    for aval in jaxpr.in_avals:
        count = int(np.prod(aval.shape))
        scalars = [Value(number_type(aval.dtype), True) for _ in range(count)]
        params += scalars
        arrays += arrays_of(scalars, [aval.shape])
    b = Builder()
    b.compact, b.trace, b.cutter = True, Trace(), outlined
    b.parameters = {x.number for x in params}
    results = scalars_of(lower(b, b.cut(jaxpr), arrays))
    with bugs_in("optimisation"):
        scalar_function = without_dead_code(Function(name, params, b.block, results))
        with_branches(scalar_function)
    return ScalarProgram(jaxpr, scalar_function, b.trace, outputs)
