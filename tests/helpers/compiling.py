"""Programs that XLA makes in half the time, for tests, and as users have them where it matters.

The tests that other versions of JAX run in CI leave XLA as it is.
"""

import os
import threading
from collections.abc import Callable
from importlib import metadata
from typing import Any

FLAGS = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
"""An XLA that does not know one of them ends the process."""


def skip_most_optimisations() -> None:
    """To be called before JAX is imported; `XLA_FLAGS` in the environment, be it empty, wins."""
    if "XLA_FLAGS" not in os.environ and metadata.version("jaxlib").startswith("0.10."):
        os.environ.update(XLA_FLAGS=FLAGS, JAX_DISABLE_MOST_OPTIMIZATIONS="1")


def share_contexts(count: int = 100) -> None:
    """Let `count` programs of a thread share a context of MLIR, which takes a fifth of the time
    that XLA and JAX need for a small program."""
    if os.environ.get("XLA_FLAGS") != FLAGS:
        return
    from jax._src.interpreters import mlir

    make, own = mlir.make_ir_context, threading.local()

    def shared() -> Any:
        if getattr(own, "left", 0) == 0:
            own.context, own.left = make(), count
        own.left -= 1
        return own.context

    mlir.make_ir_context = shared


def fully_optimised(function: Callable) -> Callable:
    """`function` jitted as users have it."""
    import jax

    if os.environ.get("XLA_FLAGS") != FLAGS:
        return jax.jit(function)
    options = {
        "xla_cpu_use_fusion_emitters": True,
        "xla_backend_optimization_level": 3,
        "xla_llvm_disable_expensive_passes": False,
    }
    return jax.jit(function, compiler_options=options)


def by_machine_code(function: Callable) -> Callable:
    """`function` compiled by jaxsat's compiler, as `equinox.filter_jit` does by XLA.

    XLA takes twice as long for a law of ten thousand operations; it compiles what ours cannot.
    """
    import equinox as eqx
    import jax

    from jaxsat.compiler import CannotLower, Mapped

    made: dict[Any, Callable] = {}

    def compiled(fixed: Any, arrays: Any) -> Callable:
        def of_arrays(case: Any, shared: Any = None) -> Any:
            return function(*eqx.combine(case, fixed))

        try:
            mapped = Mapped(of_arrays, arrays, lanes=1, kept=True)
        except CannotLower:
            return jax.jit(of_arrays)
        return lambda case: _alone(mapped(_one_case(case)))

    def called(*given: Any) -> Any:
        arrays, fixed = eqx.partition(given, eqx.is_array)
        leaves, tree = jax.tree.flatten(arrays)
        kinds = tuple((x.shape, x.dtype) for x in leaves)
        key = (tree, kinds, tuple(jax.tree.leaves(fixed)))
        if key not in made:
            made[key] = compiled(fixed, arrays)
        return made[key](arrays)

    return called


def interpreted(function: Callable, *given: Any) -> Any:
    """What `function` makes of what is `given`, without machine code: for a single call."""
    from jaxsat.compiler import Mapped

    mapped = Mapped(lambda case, _: function(*case), given)
    return _alone(mapped.interpreted(_one_case(given)))


def _one_case(given: Any) -> Any:
    import jax
    import numpy as np

    return jax.tree.map(lambda x: np.asarray(x)[None], given)


def _alone(found: Any) -> Any:
    import jax
    import jax.numpy as jnp

    return jax.tree.map(lambda x: jnp.asarray(x[0]), found)
