"""Parts of a scenario: one file per part, with its keys, rules and cautions. Needs no JAX."""
