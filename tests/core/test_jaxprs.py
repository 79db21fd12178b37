"""Every primitive has the layout that is expected of it, on this JAX; what is changed is told."""

import re
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from compiler.edge_values import MISSING
from jaxsat.compiler import CannotLower, Mapped
from jaxsat.compiler.lowering import RULES
from jaxsat.core import jax_internals
from jaxsat.core.fingerprint import fingerprint
from jaxsat.core.jaxprs import Jaxpr, jaxpr_of
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import native_obstacle
from simulation.engine.examples import EXAMPLES, KICKS, program

X, ROWS, WHOLE = jnp.arange(3.0), jnp.arange(6.0).reshape(2, 3), jnp.arange(3)
DIRECTION = {"axis": 0, "reverse": False}
WINDOW = {"window_dimensions": (2,), "window_strides": (1,), "padding": ((0, 0),)}
HALF = (2,), (1,), "VALID"


def _bent(kind):
    function = kind(lambda x: 2 * x)
    if kind is jax.custom_jvp:
        function.defjvp(lambda primals, tangents: (primals[0], tangents[0]))
    else:
        function.defvjp(lambda x: (2 * x, None), lambda _, g: (g,))
    return function


def _windowed(first, join):
    return lambda x: lax.reduce_window(x, first, join, *HALF)


LAYOUTS = {
    "while": (
        lambda x: lax.while_loop(lambda c: c[0] < x[1], lambda c: c + x[0] * X, X),
        {"n_test": 1, "n_body": 2, "test": 2, "body": 3},
    ),
    "scan": (
        lambda x: lax.scan(lambda c, y: ((c[1] * x[0] + y, c[0]), c[0] + y), (0.0, 1.0), x),
        {"n_consts": 1, "n_carry": 2, "length": 3, "reverse": False, "body": 4},
    ),
    "cond": (lambda x: lax.cond(x[0] > 0, jnp.sin, jnp.cos, x), {"branches": 1}),
    "call": (jax.jit(jnp.sin), {"body": 1}),
    "call: checkpoint": (jax.checkpoint(jnp.sin), {"body": 1}),
    "call: custom_jvp": (_bent(jax.custom_jvp), {"body": 1}),
    "call: custom_vjp": (_bent(jax.custom_vjp), {"body": 1}),
    "custom_linear_solve": (
        lambda x: lax.custom_linear_solve(lambda y: y * X, x, lambda _, y: y / X, symmetric=True),
        {"solve": 2, "before": 2, "n_solve": 1, "between": 1},
    ),
    "reshape": (
        lambda x: lax.reshape(x[None] + ROWS, (3, 2), dimensions=(1, 0)),
        {"new_sizes": (3, 2), "dimensions": (1, 0)},
    ),
    "squeeze": (lambda x: lax.squeeze(x[:1], (0,)), {"dimensions": (0,)}),
    "broadcast_in_dim": (
        lambda x: jnp.broadcast_to(x, (2, 3)),
        {"shape": (2, 3), "broadcast_dimensions": (1,)},
    ),
    "transpose": (lambda x: lax.transpose(x[None] + ROWS, (1, 0)), {"permutation": (1, 0)}),
    "slice": (
        lambda x: lax.slice(x, (0,), (3,), (2,)),
        {"start_indices": (0,), "limit_indices": (3,), "strides": (2,)},
    ),
    "concatenate": (lambda x: lax.concatenate([x, x], 0), {"dimension": 0}),
    "stack": (lambda x: jnp.stack([x, x], 1), {"axis": 1}),
    "unstack": (lambda x: lax.unstack(x[None] + ROWS, axis=1), {"axis": 1}),
    "split": (lambda x: lax.split(x, (1, 2)), {"sizes": (1, 2), "axis": 0}),
    "rev": (lambda x: lax.rev(x, (0,)), {"dimensions": (0,)}),
    "pad": (lambda x: lax.pad(x, 0.0, [(2, -1, 1)]), {"padding_config": ((2, -1, 1),)}),
    "iota": (
        lambda x: lax.broadcasted_iota(jnp.int32, (2, 3), 1),
        {"shape": (2, 3), "dimension": 1, "dtype": np.dtype(np.int32)},
    ),
    "platform_index": (
        lambda x: lax.platform_dependent(x, cpu=jnp.sin, default=jnp.cos),
        {"platforms": (("cpu",), None)},
    ),
    "dynamic_slice": (lambda x: lax.dynamic_slice(x, (WHOLE[1],), (2,)), {"slice_sizes": (2,)}),
    "gather": (
        lambda x: x.at[jnp.arange(2)].get(mode="fill", fill_value=7.0),
        {"slice_sizes": (1,), "mode": lax.GatherScatterMode.FILL_OR_DROP, "fill_value": 7.0},
    ),
    "scatter": (lambda x: x.at[WHOLE[0]].set(1.0, mode="clip"), {"update": None}),
    **{
        f"scatter-{join}": (
            lambda x, method=method: getattr(x.at[WHOLE[0]], method)(2.0, mode="clip"),
            {"mode": lax.GatherScatterMode.CLIP},
        )
        for join, method in {
            "add": "add", "sub": "subtract", "mul": "multiply", "min": "min", "max": "max"
        }.items()
    },
    **{
        f"reduce_{name}": (
            lambda x, name=name: getattr(lax, f"reduce_{name}")(x[None] + ROWS, axes=(1,)),
            {"axes": (1,)},
        )
        for name in ("sum", "prod", "max", "min")
    },
    **{
        f"reduce_{name}": (
            lambda x, name=name: getattr(lax, f"reduce_{name}")(WHOLE + (x > 0), axes=(0,)),
            {"axes": (0,)},
        )
        for name in ("and", "or", "xor")
    },
    **{
        f"cum{name}": (lambda x, name=name: getattr(lax, f"cum{name}")(x), DIRECTION)
        for name in ("sum", "prod", "max", "min", "logsumexp")
    },
    **{
        name: (
            lambda x, name=name: getattr(lax, name)(x, 0, np.int32),
            {"axes": (0,), "index_dtype": np.dtype(np.int32)},
        )
        for name in ("argmax", "argmin")
    },
    "sort": (lambda x: lax.sort((x, x, x), num_keys=2), {"dimension": 0, "num_keys": 2}),
    "top_k": (lambda x: lax.top_k(x, 2), {"k": 2, "axis": 0}),
    "tile": (lambda x: jnp.tile(x, 2), {"reps": (2,)}),
    "reduce": (
        lambda x: lax.reduce(x, 0.0, lambda a, b: a * b + 1, (0,)),
        {"dimensions": (0,), "body": 2},
    ),
    "reduce_window": (_windowed(0.0, lambda a, b: a * b + 1), WINDOW | {"body": 2}),
    "reduce_window_sum": (_windowed(0.0, lax.add), WINDOW),
    "reduce_window_max": (_windowed(-np.inf, lax.max), WINDOW),
    "reduce_window_min": (_windowed(np.inf, lax.min), WINDOW),
    "conv_general_dilated": (
        lambda x: lax.conv_general_dilated(x[None, None], jnp.ones((1, 1, 2)), (2,), [(1, 0)]),
        {"window_strides": (2,), "padding": ((1, 0),), "lhs_dilation": (1,), "rhs_dilation": (1,),
         "feature_group_count": 1, "batch_group_count": 1},
    ),
    "dot_general": (
        lambda x: ROWS @ x,
        {"dimension_numbers": (((1,), (0,)), ((), ()))},
    ),
    "triangular_solve": (
        lambda x: lax.linalg.triangular_solve(jnp.eye(3), x[:, None], left_side=True, lower=True),
        {"left_side": True, "lower": True, "transpose_a": False, "unit_diagonal": False},
    ),
    "convert_element_type": (lambda x: x.astype(np.int8), {"new_dtype": np.dtype(np.int8)}),
    "bitcast_convert_type": (
        lambda x: lax.bitcast_convert_type(x, np.int64),
        {"new_dtype": np.dtype(np.int64)},
    ),
    "round": (
        lambda x: lax.round(x, lax.RoundingMethod.TO_NEAREST_EVEN),
        {"rounding_method": lax.RoundingMethod.TO_NEAREST_EVEN},
    ),
    "reduce_precision": (
        lambda x: lax.reduce_precision(x, 5, 10),
        {"exponent_bits": 5, "mantissa_bits": 10},
    ),
    "integer_pow": (lambda x: lax.integer_pow(x, 3), {"y": 3}),
    "random_bits": (
        lambda x: jax.random.bits(jax.random.key(1), (2,), np.uint8),
        {"bit_width": 8, "shape": (2,)},
    ),
    "random_split": (lambda x: jax.random.split(jax.random.key(1), 5), {"shape": (5,)}),
    "iota_2x32_shape": (
        lambda x: _threefry_bits(jax.random.key_data(jax.random.key(1))),
        {"shape": (2,)},
    ),
}  # fmt: skip
"""By primitive, a function of a vector, and parameters; of a program, how many inputs it has."""

ELSEWHERE = {"empty", "empty2", *jax_internals.IDENTICAL}
"""Those whose parameters tell nothing; `test_edges` makes them."""


def _threefry_bits(words):
    return jax_internals.key_functions(jax.random.key(0).dtype).random_bits(words, 32, (2,))


def _all(jaxpr):
    for equation in jaxpr.equations:
        yield equation
        for inner in equation.programs():
            yield from _all(inner)


def _told(value):
    """Programs by the number of their inputs."""
    if isinstance(value, tuple) and value and isinstance(value[0], Jaxpr):
        return _told(value[0])
    return len(value.inputs) if isinstance(value, Jaxpr) else value


@pytest.mark.parametrize("primitive", sorted(set(LAYOUTS) - MISSING))
def test_a_primitive_has_the_layout_expected(primitive):
    function, expected = LAYOUTS[primitive]
    equations = list(_all(jaxpr_of(function, X)))
    assert [equation.unknown for equation in equations if equation.unknown] == []
    one = next(e for e in equations if e.name == primitive.split(":")[0])
    found = {key: _told(one.parameters[key]) for key in expected}
    assert found == expected


def test_every_layout_is_tried():
    assert (
        set(jax_internals.LAYOUTS) - ELSEWHERE - MISSING
        == {name for name in LAYOUTS if name.split(":")[0] != "call"} - MISSING
    )


def test_derivatives_batches_and_roots_have_known_layouts():
    """What JAX 0.11 and newer write as objects of their own or by other calls."""

    def function(x, shared=None):
        root = lax.custom_root(lambda y: y * y - x[1], 1.0, _newton, lambda g, y: y / g(1.0))
        several = jax.vmap(lambda n: lax.fori_loop(0, n, lambda i, c: c + i * x[2], 0.0))(WHOLE)
        rows = jax.jvp(lambda x: lax.scan(lambda c, y: (c * y, c), x[0], x), (x,), (x,))
        return jnp.interp(x, X, X), root, several, rows, jax.grad(jnp.tanh)(x[0]), jnp.polyval(X, x)

    assert [e.unknown for e in _all(jaxpr_of(function, X)) if e.unknown] == []
    x = np.array([[0.3, 2.0, 1.5], [0.1, 3.0, 0.2]])
    found, expected = Mapped(function, x[0])(x), jax.vmap(function)(x)
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)


def _newton(function, x):
    for _ in range(6):
        x = x - function(x) / (2 * x)
    return x


def renamed(monkeypatch, primitive, old, new, value=None):
    """A JAX in which a parameter of a primitive has another name, or one more."""
    real = jax_internals.layout_of

    def layout_of(equation):
        if equation.primitive.name == primitive:
            params = dict(equation.params)
            params[new] = params.pop(old) if old else value
            equation = equation.replace(params=params)
        return real(equation)

    monkeypatch.setattr(jax_internals, "layout_of", layout_of)


VERSIONS = re.escape(f"this is JAX {jax.__version__}, and jaxsat was tested with 0.10.0 to 0.12.0")

CHANGES = [
    ("while", "cond_nconsts", "test_nconsts"),
    ("scan", "length", "size"),
    ("scan", "jaxpr", "body"),
    ("cond", "branches", "choices"),
    ("jit", "jaxpr", "program"),
    ("custom_jvp_call", "call_jaxpr", "fun_jaxpr"),
    ("reshape", "dimensions", "order"),
    ("sin", None, "in_degrees"),
]


@pytest.mark.parametrize(("primitive", "old", "new"), CHANGES)
def test_a_layout_that_is_not_known_is_told_with_both_versions(monkeypatch, primitive, old, new):
    function = {"sin": (jnp.sin, None), "jit": LAYOUTS["call"], "custom_jvp_call":
                LAYOUTS["call: custom_jvp"]}.get(primitive) or LAYOUTS[primitive]  # fmt: skip
    as_it_is = fingerprint({"": jaxpr_of(function[0], X)})
    renamed(monkeypatch, primitive, old, new, True)
    with pytest.raises(CannotLower, match=rf"parameters .*{new}.* of `{primitive}`: {VERSIONS}"):
        Mapped(lambda x, _: function[0](x), np.asarray(X))
    assert fingerprint({"": jaxpr_of(function[0], X)}) != as_it_is


def test_a_study_falls_back_with_one_line(monkeypatch):
    one = EXAMPLES["corners"]()
    renamed(monkeypatch, "mul", None, "transposed", True)
    stepper = FixedStepper(one.scan.stepper.solver, 1239)  # no other test has made a kernel for
    told = native_obstacle(stepper, program(one), KICKS)
    assert told is not None
    assert re.fullmatch(rf"The native rules do not know .*`mul`: {VERSIONS}\S* \(.*\)", told)


def test_a_rule_that_breaks_down_on_another_jax_is_no_bug(monkeypatch):
    monkeypatch.setattr(jax, "__version_info__", (0, 13, 0))

    def broken(b, eqn, *arrays):
        raise IndexError("beyond the end")

    monkeypatch.setitem(RULES, "sin", broken)
    with pytest.raises(CannotLower, match=rf"rule of `sin` broke down.*beyond.*{VERSIONS}"):
        Mapped(lambda x, _: jnp.sin(x), 0.5)


def test_the_versions_declared_are_those_tested():
    root = Path(__file__).parents[2]
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    first, last = jax_internals.TESTED
    assert f"jax>={first.removesuffix('.0')}" in project["dependencies"]
    assert f"JAX {first} to {last}" in (root / "README.md").read_text(encoding="utf-8")
