"""Names and layouts of JAX that are private or move between its versions; no other file knows them.

`jaxsat.core.jaxprs` makes a stable form of JAX's traced programs with it, which all else reads.
`layout_of` gives what an equation computes under names of our own. An equation that has other
parameters than those of the versions in `TESTED` is reported as unknown, and nothing is guessed.
"""

from collections.abc import Callable, Mapping
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
"""The oldest and the newest JAX that the tests have run with."""

CALL = "call"
"""Our name for all primitives that only call a program, whatever rule for derivatives it has."""

WISH = "xla_metadata_value"
"""The primitive that returns its operand, with a hint to XLA."""

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
"""Parameters that say how an operation is compiled or differentiated, or say again what it does.

Where a derivative is taken, the operations of its rule are in the trace."""

_ONLY_ROUNDING = {
    *("accuracy", "precision", "preferred_element_type", "weak_type", "is_stable", "unroll"),
    *("unique_indices", "indices_are_sorted", "num_consts", "prevent_cse", "differentiated"),
    *("policy", "conjugate_a", "impl", "memory_space", "xla_metadata", "ad_metadata"),
}
"""Parameters on which results of operations on real numbers depend in their last bits at most."""


class OpenJaxpr(NamedTuple):
    """A jaxpr and the constants that come with it: the values of its first variables."""

    jaxpr: Jaxpr
    consts: tuple[Any, ...]


class Expanded(NamedTuple):
    """A program made for an equation that comes from where this stands."""

    jaxpr: ClosedJaxpr


class EquationLayout(NamedTuple):
    """An equation's primitive and its parameters, under names that stay.

    Parameters that no result depends on are left out. `unknown` is empty, or says what of the
    parameters is not known; then they are as JAX has them.
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
    """What an equation computes."""
    name, params = equation.primitive.name, equation.params
    layout = _CALLS.get(name) or LAYOUTS.get(name)
    if not params and layout is None:
        return EquationLayout(name, params, "")
    rest = dict(params)
    try:
        parameters = {} if layout is None else layout(rest)
    except Exception:  # whatever an object that has changed raises
        parameters, strange = {}, sorted(params)
        rest = dict(params)
    else:
        ignored = _NO_RESULT | _ONLY_ROUNDING
        strange = [key for key in rest if key not in ignored and rest[key] is not None]
    others = {key: value for key, value in rest.items() if key not in _NO_RESULT}
    unknown = f"the parameters {', '.join(strange)} of `{name}`" if strange else ""
    return EquationLayout(CALL if name in _CALLS else name, parameters | others, unknown)


def _same(*names: str) -> Callable[[dict], dict]:
    """The layout of parameters whose names have not moved."""
    return lambda rest: {name: rest.pop(name) for name in names}


def _body_in(key: str) -> Callable[[dict], dict]:
    """A call of the program `body`; `name` is that of the function."""
    return lambda rest: {"body": rest.pop(key), "name": rest.pop("name", "shared")}


def _identical(rest: dict) -> dict:
    rest.clear()
    return {}


def _while(rest: dict) -> dict:
    """Operands: `n_test` constants of the test, `n_body` of the body, and the carries."""
    return {
        "test": rest.pop("cond_jaxpr"),
        "body": rest.pop("body_jaxpr"),
        "n_test": rest.pop("cond_nconsts"),
        "n_body": rest.pop("body_nconsts"),
    }


def _scan(rest: dict) -> dict:
    """Operands: `n_consts` constants, `n_carry` carries, and arrays of `length` rows."""
    parameters = {"body": rest.pop("jaxpr")} | _same("length", "reverse")(rest)
    if "ft_in" in rest:  # from JAX 0.11 on: trees of constants, carries and rows
        n_consts, n_carry, _ = (len(list(part)) for part in rest.pop("ft_in").unpack())
        rest.pop("ft_out")
    else:
        n_consts, n_carry = rest.pop("num_consts"), rest.pop("num_carry")
    return parameters | {"n_consts": n_consts, "n_carry": n_carry}


def _linear_solve(rest: dict) -> dict:
    """Operands: `before` that are not needed, those of `solve`, `between`, and the right sides."""
    lengths, programs = rest.pop("const_lengths"), rest.pop("jaxprs")
    return {
        "solve": programs.solve,
        "before": lengths.matvec + lengths.vecmat,
        "n_solve": lengths.solve,
        "between": lengths.transpose_solve,
    }


def _reduction(*names: str) -> Callable[[dict], dict]:
    """A reduction by the program `body`."""

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
    """`update` is the program by which old and new numbers are joined, or None."""
    update = _with_constants(rest.pop("update_jaxpr"), rest.pop("update_consts"))
    return {"update": update} | _same("dimension_numbers", "mode")(rest)


def _high_level(rest: dict) -> dict:
    """From JAX 0.11 on: an object that is a primitive of its own, expanded into usual ones."""
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
    "xla_metadata_call": _body_in("jaxpr"),  # the same
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
"""By a primitive's name, what takes the parameters of its results out of JAX's own.

It raises where one is missing. Primitives that are not named here have none.
"""


def key_functions(dtype: Any) -> Any:
    """JAX's functions for random keys of a type: `seed`, `split`, `fold_in`, `random_bits`."""
    return dtype._impl


def place_of(source: Any) -> tuple[Place, ...]:
    """The calls that the `source_info` of an equation tells, from the outermost; none of JAX's."""
    try:
        frames = list(source_info_util.user_frames(source.traceback))  # pyright: ignore
        return tuple(
            Place(frame.function_name, frame.file_name, frame.start_line, frame.start_column)
            for frame in reversed(frames)
        )
    except AttributeError:  # private
        return ()


def summary_of(place: tuple[Place, ...]) -> str:
    """Where the innermost call is, for messages; nothing where none is known."""
    return "".join(f"{one.file}:{one.line}:{one.column} ({one.function})" for one in place[-1:])


def is_tested() -> bool:
    """Whether this JAX is between those in `TESTED`."""
    first, last = (tuple(map(int, version.split(".")[:3])) for version in TESTED)
    return first <= jax.__version_info__[:3] <= last


def versions() -> str:
    """This JAX and those that jaxsat was tested with, for messages."""
    return f"this is JAX {jax.__version__}, and jaxsat was tested with {TESTED[0]} to {TESTED[1]}"
