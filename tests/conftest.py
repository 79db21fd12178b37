"""Strict settings for every test: 64-bit floats, no silent rank promotion, shapes checked."""

import jax
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

install_import_hook("jaxsat", "beartype.beartype")
