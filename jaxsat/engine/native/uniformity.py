"""Which arrays of a jaxpr differ from lane to lane, found before anything is lowered.

A carry of a loop may begin the same in all lanes and come out of the body different; so loops are
gone through until nothing changes. Arrays count as wholes: one varying element makes all vary.
"""

from collections.abc import Sequence

from jax.extend.core import Jaxpr, JaxprEqn, Literal

INNER = ("jaxpr", "call_jaxpr", "fun_jaxpr")
"""Parameters that hold the jaxpr of a primitive which is nothing but a call."""


def varying_outputs(jaxpr: Jaxpr, varying: Sequence[bool]) -> list[bool]:
    """Which outputs vary where these inputs do."""
    known = dict(zip(jaxpr.invars, varying, strict=True))

    def read(atom) -> bool:
        return False if isinstance(atom, Literal) else known.get(atom, False)

    for eqn in jaxpr.eqns:
        outputs = _outputs(eqn, [read(atom) for atom in eqn.invars])
        known.update(zip(eqn.outvars, outputs, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _outputs(eqn: JaxprEqn, varying: list[bool]) -> list[bool]:
    name, params = eqn.primitive.name, eqn.params
    if name == "while":
        return while_carries(eqn, varying)[0]
    if name == "scan":
        carries, stacked = scan_outputs(eqn, varying)
        return carries + stacked
    if name == "cond":
        several = [varying_outputs(branch.jaxpr, varying[1:]) for branch in params["branches"]]
        return [varying[0] or any(one) for one in zip(*several, strict=True)]
    inner = next((params[key] for key in INNER if key in params), None)
    if inner is not None:
        return varying_outputs(getattr(inner, "jaxpr", inner), varying)
    return [any(varying)] * len(eqn.outvars)


def while_carries(eqn: JaxprEqn, varying: Sequence[bool]) -> tuple[list[bool], bool]:
    """Which carries of a `while` vary, and whether its condition does."""
    test, body = eqn.params["cond_jaxpr"].jaxpr, eqn.params["body_jaxpr"].jaxpr
    n_test, n_body = eqn.params["cond_nconsts"], eqn.params["body_nconsts"]
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


def scan_outputs(eqn: JaxprEqn, varying: Sequence[bool]) -> tuple[list[bool], list[bool]]:
    """Which carries and which stacked outputs of a `scan` vary."""
    body = eqn.params["jaxpr"].jaxpr
    n_consts, n_carry = eqn.params["num_consts"], eqn.params["num_carry"]
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
    carries = body.invars[n_consts:]
    return [out is carry for out, carry in zip(body.outvars, carries, strict=False)]
