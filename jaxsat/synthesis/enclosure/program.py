"""A function in `jax.numpy`, evaluated for affine forms."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxsat.compiler.rules.structural import MOVES
from jaxsat.core.errors import ArgumentError
from jaxsat.core.jax_internals import summary_of
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, jaxpr_of
from jaxsat.synthesis.enclosure.forms import Form, exact, unbounded
from jaxsat.synthesis.enclosure.rules import CORNERS, RULES, Rule, moving_rule

_OF_TRUTHS = ("and", "or", "not")
_OF_REALS = ("div", "floor")


def _require_reals_and_truths(equation: Equation) -> None:
    """Refuse operations whose rules are of real numbers, or of truths, on other types."""
    kinds = [np.dtype(one.aval.dtype).kind for one in equation.inputs]
    rule, got = "", equation.name
    if equation.name == "convert_element_type":
        new = np.dtype(equation.parameters["new_dtype"])
        got = f"a conversion to {new}"
        if new.kind not in "biu" and new != np.float64:
            rule = "must compute with 64-bit numbers"
        elif new.kind in "biu" and kinds != [new.kind] and kinds != ["b"]:
            rule = "must compare numbers or take their floor, which has a rule"
    elif equation.name in _OF_TRUTHS and set(kinds) != {"b"}:
        rule, got = "must use bits of truths alone", f"`{got}` of whole numbers"
    elif equation.name in _OF_REALS and set(kinds) - {"f"}:
        rule, got = "must divide real numbers", f"`{got}` of whole numbers"
    if rule:
        place = summary_of(equation.place)
        raise ArgumentError("function", rule, got + (f" in {place}" if place else ""))


class _Step(NamedTuple):
    """An operation with the numbers of its operands and results."""

    name: str
    rule: Rule
    parameters: Mapping[str, Any]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


class FormProgram:
    """A function of arrays of the shapes of examples, evaluated for affine forms.

    Operations on constants are done once, and equal operations once a call. A `smooth` program has
    unbounded results where an operation may be at a corner or a jump. Raises `ArgumentError` for
    an operation without a rule.
    """

    def __init__(self, function: Callable, *examples: Any, smooth: bool = False):
        self._smooth = smooth
        with jax.enable_x64(True):
            program = jaxpr_of(function, *(np.asarray(one, float) for one in examples))
        self._constants: dict[int, Form] = {}
        self._known: dict[Any, tuple[int, ...]] = {}
        self._count = len(program.inputs)
        self._steps: list[_Step] = []
        self._outputs = self._inline(program, range(self._count))
        operands, steps = set(self._outputs), []
        for step in reversed(self._steps):
            if operands.intersection(step.outputs):
                operands.update(step.inputs)
                steps.append(step)
        self._steps = steps[::-1]

    def __call__(self, *forms: Form) -> list[Form]:
        """Return the forms of all results."""
        values = {**self._constants, **dict(enumerate(forms))}
        with np.errstate(all="ignore"):
            for step in self._steps:
                operands = [values[one] for one in step.inputs]
                results = step.rule(step.parameters, *operands)
                if isinstance(results, Form):
                    if self._smooth and step.name in CORNERS:
                        results = unbounded(CORNERS[step.name](*operands), results)
                    results = [results]
                values.update(zip(step.outputs, results, strict=True))
        return [values[one] for one in self._outputs]

    def _constant(self, value: Any) -> int:
        array = np.asarray(value)
        key = (array.shape, array.astype(float).tobytes())
        if key not in self._known:
            self._known[key] = (self._count,)
            self._constants[self._count] = exact(array)
            self._count += 1
        return self._known[key][0]

    def _inline(self, program: Jaxpr, inputs: Sequence[int]) -> list[int]:
        """Add a program's steps; return the numbers of its results."""
        places: dict[Any, int] = dict(zip(program.inputs, inputs, strict=True))
        places |= {variable: self._constant(value) for variable, value in program.constants}

        def place(atom: Any) -> int:
            return self._constant(atom.value) if isinstance(atom, Literal) else places[atom]

        for equation in program.equations:
            operands = tuple([place(atom) for atom in equation.inputs])
            if equation.is_call:
                results = self._inline(equation.parameters["body"], operands)
            else:
                results = self._added(equation, operands)
            places.update(zip(equation.outputs, results, strict=True))
        return [place(atom) for atom in program.outputs]

    def _added(self, equation: Equation, operands: tuple[int, ...]) -> tuple[int, ...]:
        """Add an operation unless it is known; return the numbers of its results."""
        key = (equation.name, operands, repr(equation.parameters))
        if key in self._known:
            return self._known[key]
        moves = equation.name in MOVES and not equation.unknown
        if moves and not operands:
            return (self._constant(MOVES[equation.name](equation)),)
        rule = moving_rule(equation) if moves else RULES.get(equation.name)
        if rule is None or equation.unknown:
            place = summary_of(equation.place)
            got = f"`{equation.name}`" + (f" in {place}" if place else "")
            raise ArgumentError("function", "must contain only operations with a rule", got)
        _require_reals_and_truths(equation)
        results = tuple(range(self._count, self._count + len(equation.outputs)))
        self._count += len(results)
        step = _Step(equation.name, rule, equation.parameters, operands, results)
        if all(one in self._constants for one in operands):
            self._fold(equation, step)
        else:
            self._steps.append(step)
        self._known[key] = results
        return results

    def _fold(self, equation: Equation, step: _Step) -> None:
        """Do a step on constants; whole numbers remain exact."""
        with np.errstate(all="ignore"):
            results = step.rule(step.parameters, *(self._constants[one] for one in step.inputs))
        results = [results] if isinstance(results, Form) else results
        for output, number, form in zip(equation.outputs, step.outputs, results, strict=True):
            if output.aval.dtype.kind in "iub" and (form.reach < 0.1).all():
                form = exact(np.round(form.center))
            self._constants[number] = form
