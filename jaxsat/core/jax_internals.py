"""Private or version-dependent names and layouts of JAX, confined to this file.

`jaxsat.core.jaxprs` converts JAX's traced programs to a stable form with it, which all other code
reads. `layout_of` describes an equation under names of our own. An equation with other parameters
than those of the versions in `TESTED` is reported as unknown, without guessing.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
from jax.core import Tracer as Tracer
from jax.extend.core import ClosedJaxpr as ClosedJaxpr
from jax.extend.core import DropVar as DropVar
from jax.extend.core import Jaxpr as Jaxpr
from jax.extend.core import JaxprEqn as JaxprEqn
from jax.extend.core import Literal as Literal
from jax.extend.core import Primitive as Primitive
from jax.extend.core import Var as Var
from jax.extend.core import jaxpr_as_fun as jaxpr_as_fun
from jax.interpreters import ad as ad
from jax.interpreters import batching as batching
from jax.interpreters import mlir as mlir

try:
    from jax._src import source_info_util
except ImportError:  # private
    source_info_util = None

TESTED = ("0.10.0", "0.12.0.1")
"""Oldest and newest JAX that the tests have run with."""

CALL = "call"
"""Name for all primitives that only call a program, whatever their rule for derivatives."""

WISH = "xla_metadata_value"
"""Primitive that returns its operand, with a hint to XLA."""

IDENTICAL = (
    *("copy", "stop_gradient", "optimization_barrier", "pvary", "name", "reshard"),
    *(WISH, "sharding_constraint"),
)
"""Primitives that return their operands."""

_NO_RESULT = {
    *("name", "inline", "keep_unused", "donated_invars", "compiler_options_kvs", "ctx_mesh"),
    *("in_shardings", "out_shardings", "in_layouts", "out_layouts", "sharding", "out_sharding"),
    *("jvp_jaxpr_fun", "fwd_jaxpr_thunk", "bwd", "out_trees", "symbolic_zeros", "computation"),
    "branches_platforms",
}
"""Parameters that affect only compilation or differentiation, or are redundant. Where a derivative
is taken, the operations of its rule are in the trace."""

_ONLY_ROUNDING = {
    *("accuracy", "precision", "preferred_element_type", "weak_type", "is_stable", "unroll"),
    *("unique_indices", "indices_are_sorted", "num_consts", "prevent_cse", "differentiated"),
    *("policy", "conjugate_a", "impl", "memory_space", "xla_metadata", "ad_metadata"),
}
"""Parameters that affect real results by round-off at most."""


class OpenJaxpr(NamedTuple):
    """A jaxpr and its constants: the values of its first variables."""

    jaxpr: Jaxpr
    consts: tuple[Any, ...]


class Expanded(NamedTuple):
    """A program that expands an equation, with the equation's source position."""

    jaxpr: ClosedJaxpr


class EquationLayout(NamedTuple):
    """An equation's primitive and its parameters, under stable names.

    Parameters without effect on results are left out. `unknown` is empty, or describes the unknown
    parameters; then they are JAX's own.
    """

    name: str
    parameters: Mapping[str, Any]
    unknown: str


class Place(NamedTuple):
    """A call in the source: function, file, line and column."""

    function: str
    file: str
    line: int
    column: int


def layout_of(equation: JaxprEqn) -> EquationLayout:
    """Return the primitive and the parameters of an equation under stable names."""
    name, params = equation.primitive.name, equation.params
    layout = _CALLS.get(name) or LAYOUTS.get(name)
    if not params and layout is None:
        return EquationLayout(name, params, "")
    rest = dict(params)
    try:
        parameters = {} if layout is None else layout(rest)
    except Exception:  # any error of a changed object
        parameters, strange = {}, sorted(params)
        rest = dict(params)
    else:
        ignored = _NO_RESULT | _ONLY_ROUNDING
        strange = [key for key in rest if key not in ignored and rest[key] is not None]
    others = {key: value for key, value in rest.items() if key not in _NO_RESULT}
    unknown = f"the parameters {', '.join(strange)} of `{name}`" if strange else ""
    return EquationLayout(CALL if name in _CALLS else name, parameters | others, unknown)


def _same(*names: str) -> Callable[[dict], dict]:
    """Return the layout of parameters with unchanged names."""
    return lambda rest: {name: rest.pop(name) for name in names}


def _body_in(key: str) -> Callable[[dict], dict]:
    """Return the layout of a call of the program `body`; `name` is that of the function."""
    return lambda rest: {"body": rest.pop(key), "name": rest.pop("name", "shared")}


def _identical(rest: dict) -> dict:
    rest.clear()
    return {}


def _while(rest: dict) -> dict:
    """Return a layout; operands are `n_test` constants of the test, `n_body` ones, carries."""
    return {
        "test": rest.pop("cond_jaxpr"),
        "body": rest.pop("body_jaxpr"),
        "n_test": rest.pop("cond_nconsts"),
        "n_body": rest.pop("body_nconsts"),
    }


def _scan(rest: dict) -> dict:
    """Return a layout; operands are `n_consts` constants, `n_carry` carries, rows of `length`."""
    parameters = {"body": rest.pop("jaxpr")} | _same("length", "reverse")(rest)
    if "ft_in" in rest:  # from JAX 0.11 on: trees of constants, carries and rows
        n_consts, n_carry, _ = (len(list(part)) for part in rest.pop("ft_in").unpack())
        rest.pop("ft_out")
    else:
        n_consts, n_carry = rest.pop("num_consts"), rest.pop("num_carry")
    return parameters | {"n_consts": n_consts, "n_carry": n_carry}


def _linear_solve(rest: dict) -> dict:
    """Return a layout; operands are unused ones (`before`), `solve`'s, `between`, right sides."""
    lengths, programs = rest.pop("const_lengths"), rest.pop("jaxprs")
    return {
        "solve": programs.solve,
        "before": lengths.matvec + lengths.vecmat,
        "n_solve": lengths.solve,
        "between": lengths.transpose_solve,
    }


def _reduction(*names: str) -> Callable[[dict], dict]:
    """Return the layout of a reduction by the program `body`."""

    def layout(rest: dict) -> dict:
        body = _with_constants(rest.pop("jaxpr"), rest.pop("consts", ()))
        return {"body": body} | _same(*names)(rest)

    return layout


def _with_constants(program: Any, constants: Any) -> Any:
    return OpenJaxpr(program, tuple(constants)) if constants else program


def _gather(rest: dict) -> dict:
    return {"fill_value": rest.pop("fill_value", None)} | _same(
        "dimension_numbers", "slice_sizes", "mode"
    )(rest)


def _scatter(rest: dict) -> dict:
    """Return a layout; `update` is the program that combines old and new numbers, or None."""
    update = _with_constants(rest.pop("update_jaxpr"), rest.pop("update_consts"))
    return {"update": update} | _same("dimension_numbers", "mode")(rest)


def _high_level(rest: dict) -> dict:
    """Expand a high-level primitive, an object from JAX 0.11 on, into ordinary ones."""
    primitive = rest.pop("_prim")

    def expanded(*leaves):
        return jax.tree.leaves(primitive.expand(*jax.tree.unflatten(primitive.in_tree, leaves)))

    body = Expanded(jax.make_jaxpr(expanded)(*primitive.in_avals_flat))
    return {"body": body, "name": type(primitive).__name__}


_CALLS: dict[str, Callable[[dict], dict]] = {
    "jit": _body_in("jaxpr"),
    "remat2": _body_in("jaxpr"),
    "closed_call": _body_in("call_jaxpr"),  # until JAX 0.10
    "eval_jaxpr": _body_in("call_jaxpr"),  # from JAX 0.11 on
    "xla_metadata_call": _body_in("jaxpr"),  # from JAX 0.11 on
    "custom_jvp_call": _body_in("call_jaxpr"),
    "custom_vjp_call": _body_in("call_jaxpr"),
    "call_hi_primitive": _high_level,
}

_WINDOW = ("window_dimensions", "window_strides", "padding", "base_dilation", "window_dilation")
_ALONG = ("axis", "reverse")

LAYOUTS: dict[str, Callable[[dict], dict]] = {
    **dict.fromkeys(IDENTICAL, _identical),
    "while": _while,
    "scan": _scan,
    "cond": _same("branches"),
    "custom_linear_solve": _linear_solve,
    "reshape": _same("new_sizes", "dimensions"),
    "squeeze": _same("dimensions"),
    "empty": _same("shape", "dtype"),
    "empty2": _same("dtype"),
    "iota_2x32_shape": _same("shape"),
    "broadcast_in_dim": _same("shape", "broadcast_dimensions"),
    "transpose": _same("permutation"),
    "slice": _same("start_indices", "limit_indices", "strides"),
    "concatenate": _same("dimension"),
    "stack": _same("axis"),
    "unstack": _same("axis"),
    "split": _same("sizes", "axis"),
    "rev": _same("dimensions"),
    "pad": _same("padding_config"),
    "iota": _same("shape", "dimension", "dtype"),
    "platform_index": _same("platforms"),
    "dynamic_slice": _same("slice_sizes"),
    "gather": _gather,
    **{f"scatter{end}": _scatter for end in ("", "-add", "-sub", "-mul", "-min", "-max")},
    **{
        f"reduce_{name}": _same("axes")
        for name in ("sum", "prod", "max", "min", "and", "or", "xor")
    },
    **{f"cum{name}": _same(*_ALONG) for name in ("sum", "prod", "max", "min", "logsumexp")},
    "argmax": _same("axes", "index_dtype"),
    "argmin": _same("axes", "index_dtype"),
    "sort": _same("dimension", "num_keys"),
    "top_k": _same("k", "axis"),
    "tile": _same("reps"),
    "reduce": _reduction("dimensions"),
    "reduce_window": _reduction(*_WINDOW),
    **{f"reduce_window_{name}": _same(*_WINDOW) for name in ("sum", "max", "min")},
    "conv_general_dilated": _same(
        *("window_strides", "padding", "lhs_dilation", "rhs_dilation"),
        *("dimension_numbers", "feature_group_count", "batch_group_count"),
    ),
    "dot_general": _same("dimension_numbers"),
    "triangular_solve": _same("left_side", "lower", "transpose_a", "unit_diagonal"),
    "convert_element_type": _same("new_dtype"),
    "bitcast_convert_type": _same("new_dtype"),
    "round": _same("rounding_method"),
    "reduce_precision": _same("exponent_bits", "mantissa_bits"),
    "integer_pow": _same("y"),
    "random_bits": _same("bit_width", "shape"),
    "random_split": _same("shape"),
}
"""Functions by primitive name that take the parameters of results out of JAX's own.

They raise where one is missing. Primitives without an entry have no such parameters.
"""


def without_own_rules(function: Callable, *examples: Any) -> Callable[..., list]:
    """Return a function of arrays that has no derivatives of its own, so that JAX differentiates
    each of its operations. It returns a list of its results."""
    closed = jax.make_jaxpr(function)(*examples)
    return lambda *values: _evaluate(closed, values)


def _evaluate(program: Any, values: Sequence[Any]) -> list[Any]:
    closed = program.jaxpr if isinstance(program, Expanded) else program
    jaxpr, constants = getattr(closed, "jaxpr", closed), getattr(closed, "consts", ())
    variables = [*jaxpr.constvars, *jaxpr.invars]
    places = dict(zip(variables, [*constants, *values], strict=True))

    def value(atom: Any) -> Any:
        return atom.val if isinstance(atom, Literal) else places[atom]

    for equation in jaxpr.eqns:
        operands, layout = [value(atom) for atom in equation.invars], layout_of(equation)
        if layout.name in IDENTICAL:
            results = operands
        elif layout.name == CALL and not layout.unknown:
            results = _evaluate(layout.parameters["body"], operands)
        else:
            results = equation.primitive.bind(*operands, **equation.params)
            results = results if equation.primitive.multiple_results else [results]
        places.update(zip(equation.outvars, results, strict=True))
    return [value(atom) for atom in jaxpr.outvars]


def key_functions(dtype: Any) -> Any:
    """Return JAX's functions for keys of a type: `seed`, `split`, `fold_in`, `random_bits`."""
    return dtype._impl


def place_of(source: Any) -> tuple[Place, ...]:
    """Return the calls in an equation's `source_info`, from the outermost, without JAX's own."""
    try:
        frames = list(source_info_util.user_frames(source.traceback))  # pyright: ignore
        return tuple(
            Place(frame.function_name, frame.file_name, frame.start_line, frame.start_column)
            for frame in reversed(frames)
        )
    except AttributeError:  # private
        return ()


def summary_of(place: tuple[Place, ...]) -> str:
    """Return the place of the innermost call for messages; empty where it is unknown."""
    return "".join(f"{one.file}:{one.line}:{one.column} ({one.function})" for one in place[-1:])


def is_tested() -> bool:
    """Whether this JAX is between the versions in `TESTED`."""
    first, last = (tuple(map(int, version.split(".")[:3])) for version in TESTED)
    return first <= jax.__version_info__[:3] <= last


def versions() -> str:
    """Return this JAX version and the tested ones, for messages."""
    return f"this is JAX {jax.__version__}, and jaxsat was tested with {TESTED[0]} to {TESTED[1]}"
