"""Rules of typed random keys and Threefry: every key is one 64-bit number, moved like any other."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.lowering import KEYS, Elements, as_elements, each, function_of, lowers, written
from jaxsat.core.jax_internals import key_functions
from jaxsat.core.jaxprs import jaxpr_of
from jaxsat.core.noise import threefry

WORD = np.dtype(np.uint32)


@lowers("random_wrap")
def _wrap(b: Builder, eqn, words: Elements) -> Elements:
    del eqn
    return each(lambda x, y: _joined(b, x, y), words[..., 0], words[..., 1])


@lowers("random_unwrap")
def _unwrap(b: Builder, eqn, keys: Elements) -> Elements:
    del eqn
    return _words(b, keys)


@lowers("random_clone")
def _clone(b: Builder, eqn, keys: Elements) -> Elements:
    del b, eqn
    return keys


def _joined(b: Builder, first: Scalar, second: Scalar) -> Scalar:
    above = b.operation("shift_left", b.convert(first, KEYS), KEYS.type(32))
    return b.operation("or", above, b.convert(second, KEYS))


def _words(b: Builder, keys: Elements) -> Elements:
    """Return both words of every key along a last axis."""
    first = each(lambda x: b.operation("shift_right_logical", x, KEYS.type(32)), keys)
    halves = [each(lambda x: b.convert(x, WORD), half) for half in (first, keys)]
    return np.stack(halves, axis=-1)


def _mapped(function: Callable, times: int) -> Callable:
    for _ in range(times):
        function = jax.vmap(function)
    return function


@lowers("random_seed")
def _seed(b: Builder, eqn, seeds: Elements) -> Elements:
    seed = _mapped(key_functions(eqn.outputs[0].aval.dtype).seed, seeds.ndim)
    return _wrap(b, eqn, written(b, seed, eqn.inputs, seeds)[0])


@lowers("random_bits")
def _bits(b: Builder, eqn, keys: Elements) -> Elements:
    width, shape = eqn.parameters["bit_width"], eqn.parameters["shape"]
    draw = _mapped(lambda key: _kind(eqn).random_bits(key, width, shape), keys.ndim)
    return written(b, draw, [_key_words(keys)], _words(b, keys))[0]


@lowers("random_split")
def _split(b: Builder, eqn, keys: Elements) -> Elements:
    shape = eqn.parameters["shape"]
    split = _mapped(lambda key: _kind(eqn).split(key, shape), keys.ndim)
    return _wrap(b, eqn, written(b, split, [_key_words(keys)], _words(b, keys))[0])


@lowers("random_fold_in")
def _fold_in(b: Builder, eqn, keys: Elements, numbers: Elements) -> Elements:
    keys = np.broadcast_to(keys, eqn.outputs[0].aval.shape)
    numbers = np.broadcast_to(numbers, keys.shape)
    fold = _mapped(_kind(eqn).fold_in, keys.ndim)
    words = jax.ShapeDtypeStruct(keys.shape, eqn.inputs[1].aval.dtype)
    folded = written(b, fold, [_key_words(keys), words], _words(b, keys), numbers)
    return _wrap(b, eqn, folded[0])


def _kind(eqn):
    return key_functions(eqn.inputs[0].aval.dtype)


def _key_words(keys: Elements) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((*keys.shape, 2), WORD)


@lowers("iota_2x32_shape")
def _counters(b: Builder, eqn) -> list[Elements]:
    """Return the index of every element as two words."""
    del b
    shape = eqn.outputs[0].aval.shape
    numbers = np.arange(int(np.prod(shape)), dtype=KEYS).reshape(shape)
    return [as_elements((numbers >> KEYS.type(32)).astype(WORD)), as_elements(numbers.astype(WORD))]


@lowers("threefry2x32")
def _threefry(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    """Encrypt every counter's two words, by a function lowered once."""
    shape = eqn.outputs[0].aval.shape
    flats = [np.broadcast_to(x, shape).reshape(-1) for x in arrays]
    pairs = [_encrypted(b, scalars) for scalars in zip(*flats, strict=True)]
    out = np.empty((2, len(pairs)), object)
    for i, pair in enumerate(pairs):
        out[:, i] = pair
    return [row.reshape(shape) for row in out]


def _encrypted(b: Builder, scalars: tuple[Scalar, ...]) -> list[Scalar]:
    program = jaxpr_of(
        lambda first, second, x, y: threefry(jnp.stack([first, second]), x, y),
        *[np.zeros((), WORD)] * 4,
    )
    function = function_of(b, "threefry2x32", program, scalars)
    if not any(isinstance(x, Value) for x in scalars):
        return [WORD.type(word) for word in interpret(function, scalars)]  # pyright: ignore
    return b.call(function, scalars)
