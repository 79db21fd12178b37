"""Which arrays of a jaxpr differ from lane to lane, found before anything is lowered.

A carry of a loop may begin the same in all lanes and come out of the body different; so loops are
gone through until nothing changes. Arrays count as wholes: one varying element makes all vary.
"""

from collections.abc import Sequence

from jaxsat.core.jaxprs import Equation, Jaxpr, Literal


def varying_outputs(jaxpr: Jaxpr, varying: Sequence[bool]) -> list[bool]:
    """Which outputs vary where these inputs do."""
    known = dict(zip(jaxpr.inputs, varying, strict=True))

    def read(atom) -> bool:
        return False if isinstance(atom, Literal) else known.get(atom, False)

    for eqn in jaxpr.equations:
        outputs = _outputs(eqn, [read(atom) for atom in eqn.inputs])
        known.update(zip(eqn.outputs, outputs, strict=True))
    return [read(atom) for atom in jaxpr.outputs]


def _outputs(eqn: Equation, varying: list[bool]) -> list[bool]:
    if eqn.name == "while" and not eqn.unknown:
        return while_carries(eqn, varying)[0]
    if eqn.name == "scan" and not eqn.unknown:
        carries, stacked = scan_outputs(eqn, varying)
        return carries + stacked
    if eqn.name == "cond" and not eqn.unknown:
        several = [varying_outputs(branch, varying[1:]) for branch in eqn.programs()]
        return [varying[0] or any(one) for one in zip(*several, strict=True)]
    if eqn.is_call:
        return varying_outputs(eqn.parameters["body"], varying)
    return [any(varying)] * len(eqn.outputs)


def while_carries(eqn: Equation, varying: Sequence[bool]) -> tuple[list[bool], bool]:
    """Which carries of a `while` vary, and whether its condition does."""
    test, body = eqn.parameters["test"], eqn.parameters["body"]
    n_test, n_body = eqn.parameters["n_test"], eqn.parameters["n_body"]
    of_test, of_body = list(varying[:n_test]), list(varying[n_test : n_test + n_body])
    carries = list(varying[n_test + n_body :])
    while True:
        condition = varying_outputs(test, of_test + carries)[0]
        after = varying_outputs(body, of_body + carries)
        changed = [not same for same in unchanged(body, n_body)]
        widened = [
            old or new or (condition and changes)
            for old, new, changes in zip(carries, after, changed, strict=True)
        ]
        if widened == carries:
            return carries, condition
        carries = widened


def scan_outputs(eqn: Equation, varying: Sequence[bool]) -> tuple[list[bool], list[bool]]:
    """Which carries and which stacked outputs of a `scan` vary."""
    body = eqn.parameters["body"]
    n_consts, n_carry = eqn.parameters["n_consts"], eqn.parameters["n_carry"]
    consts, xs = list(varying[:n_consts]), list(varying[n_consts + n_carry :])
    carries = list(varying[n_consts : n_consts + n_carry])
    while True:
        after = varying_outputs(body, consts + carries + xs)
        widened = [old or new for old, new in zip(carries, after[:n_carry], strict=True)]
        if widened == carries:
            return carries, after[n_carry:]
        carries = widened


def unchanged(body: Jaxpr, n_consts: int) -> list[bool]:
    """Which carries a body hands on as they are."""
    carries = body.inputs[n_consts:]
    return [out is carry for out, carry in zip(body.outputs, carries, strict=False)]
