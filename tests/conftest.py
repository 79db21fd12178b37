"""Strict settings for every test: 64-bit floats, no silent rank promotion, shapes checked."""

import signal

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

install_import_hook("jaxsat", "beartype.beartype")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in a shell's background job: programs started by tests would ignore Ctrl-C as well.
    signal.signal(signal.SIGINT, signal.default_int_handler)
