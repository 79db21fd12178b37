"""A campaign of wrong arguments against machine code, in a process of its own: none may crash.

    python -m compiler.wrong_arguments SEED TRIALS

Some functions are compiled once; each trial calls one of them with arguments of which some are
changed. A call must raise `TypeError` or `ValueError`, or give what it gives for plain arrays of
the same numbers. Prints what it counted; exit status 1 tells of another error or another result.
"""

import collections
import gc
import sys
import threading

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxsat.compiler import Mapped

jax.config.update("jax_enable_x64", True)

COUNT = 13


def picked(case, table):
    """Gathers, from a table in memory and from one of a case, by an index that may be anything."""
    x, index = case["x"], case["index"]
    own = jnp.outer(x, jnp.arange(20.0)).reshape(-1)
    kept = lax.dynamic_slice(table, (index,), (2,)).sum()
    return table[index] + own[index] + own.at[index].get(mode="fill", fill_value=7.0), kept


def summed(case, scale):
    """A scan whose rows are in the arena."""
    last, rows = lax.scan(lambda c, i: (0.5 * c + i, c), case * scale[0], jnp.arange(3000.0))
    return last + rows[1500] * scale[1]


def narrow(case, shared):
    """Small types, and a scalar of each."""
    small, single, flag = case
    return jnp.where(flag, small.astype(jnp.float32) * single, shared["gain"])


def drawn(case, shared):
    """A typed random key."""
    return jax.random.normal(case) + shared


def examples():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((COUNT, 3))
    keys = jax.vmap(jax.random.key)(jnp.arange(COUNT))
    return [
        (picked, {"x": x, "index": rng.integers(-99, 99, COUNT)}, np.arange(40.0)),
        (summed, x[:, 0], np.array([1.0, 2.0])),
        (
            narrow,
            (np.arange(COUNT, dtype=np.int8), np.float32(x[:, 1]), x[:, 2] > 0),
            {"gain": np.float32(3.0)},
        ),
        (drawn, keys, np.float64(0.5)),
    ]


def compiled(function, cases, shared) -> Mapped:
    return Mapped(function, jax.tree.map(lambda leaf: leaf[0], cases), shared)


def changes(rng: np.random.Generator):
    """What may be done to one array; most of it makes it a wrong one."""
    n = int(rng.integers(0, 40))

    def dtype(name):
        return lambda x: np.asarray(x).astype(name)

    def strided(x):
        return np.repeat(np.asarray(x), 2, axis=0)[::2]

    def unaligned(x):
        x = np.asarray(x)
        room = np.zeros(x.nbytes + 1, np.uint8)[1:]
        return np.ndarray(x.shape, x.dtype, room.data)

    return [
        lambda x: x[:n],
        lambda x: x[..., :1],
        lambda x: x[None],
        lambda x: x[0],
        lambda x: np.reshape(x, -1)[0],
        lambda x: np.concatenate([x, x]),
        lambda x: np.zeros((0,)),
        lambda x: np.zeros((COUNT, 0)),
        lambda x: np.broadcast_to(np.float64(1.0), (n, 3)),
        lambda x: np.broadcast_to(np.float64(1.0), (1 << 40,)).reshape(1 << 20, -1)[:n],
        lambda x: np.asfortranarray(np.asarray(x)),
        lambda x: np.asarray(x)[::-1][::-1],
        lambda x: np.asarray(x).astype(np.asarray(x).dtype.newbyteorder()),
        lambda x: np.ma.masked_array(np.asarray(x), mask=True),
        strided,
        unaligned,
        *map(dtype, ["float16", "float32", "float64", "longdouble", "complex128", "int8", "int64"]),
        *map(dtype, ["uint64", "bool", "object", "S8", "U8", "M8[s]", "m8[s]", "V16"]),
        lambda x: jnp.asarray(x, jnp.bfloat16),
        lambda x: jax.random.key(n),
        lambda x: jax.vmap(jax.random.key)(jnp.arange(n + 1)),
        lambda x: jax.vmap(lambda i: jax.random.key(i, impl="rbg"))(jnp.arange(COUNT)),
        lambda x: np.asarray(x).tolist(),
        lambda x: {"x": x},
        lambda x: (x, x),
        lambda x: None,
        lambda x: "text",
        lambda x: 1 << int(rng.integers(1, 99)),
        lambda x: -1,
        lambda x: True,
        lambda x: np.nan,
        lambda x: object(),
        lambda x: len,
        lambda x: np.array(None),
        lambda x: np.array([[1.0], [2.0]], object),
        lambda x: memoryview(np.ascontiguousarray(np.asarray(x))),
        lambda x: np.rec.fromarrays([np.asarray(x)]),
        jnp.asarray,
    ]


def changed(rng: np.random.Generator, cases, shared):
    """The arguments with one to three leaves changed, or their trees."""
    trees = [cases, shared]
    for _ in range(rng.integers(1, 4)):
        which = int(rng.integers(2))
        some = changes(rng)
        change = some[rng.integers(len(some))]
        leaves, structure = jax.tree.flatten(trees[which])
        if not leaves or rng.integers(8) == 0:
            trees[which] = [None, (), [], {}, trees[1 - which], [trees[which]]][rng.integers(6)]
            continue
        place = int(rng.integers(len(leaves)))
        leaves[place] = change(leaves[place])
        trees[which] = jax.tree.unflatten(structure, leaves)
    return trees


def plain(mapped: Mapped, trees):
    """The same arguments as arrays nobody could object to."""
    leaves = iter(mapped.jaxpr.in_avals)

    def one(x):
        aval = next(leaves)
        if jnp.issubdtype(aval.dtype, jax.dtypes.prng_key):
            return x
        return np.ascontiguousarray(np.asarray(x), aval.dtype).reshape(np.shape(x))

    return jax.tree.map(one, trees[0]), jax.tree.map(one, trees[1])


def trial(rng: np.random.Generator, made, counts: collections.Counter) -> None:
    function, cases, shared, mapped = made[rng.integers(len(made))]
    try:
        trees = changed(rng, cases, shared)
    except Exception:  # a change that cannot be done, such as a slice of a number
        counts["no change"] += 1
        return
    try:
        found = mapped(*trees)
    except (TypeError, ValueError):
        counts["refused"] += 1
        return
    except Exception as error:
        counts[f"wrong: {function.__name__} raised {error!r}"] += 1
        return
    counts["accepted"] += 1
    same = jax.tree.map(
        lambda x, y: x.tobytes() == y.tobytes(), found, mapped(*plain(mapped, trees))
    )
    if not all(jax.tree.leaves(same)):
        counts[f"wrong: {function.__name__} gave another result"] += 1


def main(seed: int, trials: int) -> int:
    made = [(*example, compiled(*example)) for example in examples()]
    for _, cases, shared, mapped in made:
        mapped(cases, shared)
    counts: collections.Counter = collections.Counter()

    def work(number: int, times: int) -> None:
        rng = np.random.default_rng([seed, number])
        for _ in range(times):
            trial(rng, made, counts)
        gc.collect()

    threads = [threading.Thread(target=work, args=(i, trials // 4)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for what, count in sorted(counts.items()):
        print(f"{count:7d}  {what}")
    return int(any(what.startswith("wrong") for what in counts))


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
