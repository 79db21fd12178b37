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
