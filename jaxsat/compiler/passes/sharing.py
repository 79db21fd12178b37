"""Equal values of a traced program, which functions need not compute again."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from jaxsat.core.fingerprint import parameter_text
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, Variable


class Values:
    """Value numbering of a jaxpr's variables: equal numbers for the same operations.

    `uses` are the indices of equations that read a variable; the results come after all of them.
    """

    def __init__(self, jaxpr: Jaxpr, eqns: Sequence[Equation]):
        self._numbers: dict[Any, tuple[int, int]] = {}
        self._places: dict[tuple[int, int], list[int]] = {}
        self._same: dict[Any, Any] = {}
        self.uses: dict[Any, list[int]] = {}
        numbers: dict[Any, int] = {}
        for place, eqn in enumerate(eqns):
            key = (eqn.name, parameter_text(eqn), *map(self.identity, eqn.inputs))
            number = numbers.setdefault(key, len(numbers))
            for i, var in enumerate(eqn.outputs):
                self._numbers[var] = value = (number, i)
                self._places.setdefault(value, []).append(place)
            for atom in eqn.inputs:
                self._read(atom, place)
        for atom in jaxpr.outputs:
            self._read(atom, len(eqns))

    def _read(self, atom: Any, place: int) -> None:
        if isinstance(atom, Variable):
            self.uses.setdefault(atom, []).append(place)

    def identity(self, atom: Any) -> Any:
        """Return a key that only equal values share."""
        if isinstance(atom, Literal):
            value = np.asarray(atom.value)
            return (str(atom.aval), value.dtype.char, value.tobytes())
        return self._numbers.get(atom, id(atom))

    def is_made_outside(self, var: Any, first: int, end: int) -> bool:
        """Whether equations outside `first` to before `end` make the same value."""
        places = self._places.get(self._numbers.get(var, (-1, 0)), ())
        return any(not first <= place < end for place in places)

    def is_read_outside(self, var: Any, first: int, end: int) -> bool:
        """Whether equations outside `first` to before `end` read the variable."""
        return any(not first <= place < end for place in self.uses.get(var, ()))

    def unite(self, var: Any, other: Any) -> None:
        """Replace `other` by the variable from now on."""
        self._same[other] = var
        self.uses.setdefault(var, []).extend(self.uses.get(other, ()))

    def atom(self, atom: Any) -> Any:
        """Return the variable that now stands for this one."""
        while isinstance(atom, Variable) and atom in self._same:
            atom = self._same[atom]
        return atom


def without_repeated_calls(
    values: Values,
    eqns: Sequence[Equation],
    function_of: Callable[[Equation], Any],
    changed: Callable[..., Equation],
) -> list[Equation]:
    """Remove calls that repeat earlier ones.

    `function_of` gives the function of a call, and None for other equations; `changed` replaces
    parts of an equation.
    """
    unique: list[Equation] = []
    calls: dict[Any, int] = {}
    for eqn in eqns:
        renamed = tuple([values.atom(atom) for atom in eqn.inputs])
        if any(new is not old for new, old in zip(renamed, eqn.inputs, strict=True)):
            eqn = changed(eqn, inputs=renamed)
        function = function_of(eqn)
        if function is not None:
            key = (id(function), *map(values.identity, eqn.inputs))
            if key in calls:
                unique[calls[key]] = _with_results(values, unique[calls[key]], eqn, changed)
                continue
            calls[key] = len(unique)
        unique.append(eqn)
    return unique


def _with_results(values: Values, first: Equation, other: Equation, changed) -> Equation:
    """Return a call with the additional results of an equal one."""
    outs = []
    for one, two in zip(first.outputs, other.outputs, strict=True):
        if not (one.dropped or two.dropped):
            values.unite(one, two)
        outs.append(two if one.dropped else one)
    return changed(first, outputs=tuple(outs))
