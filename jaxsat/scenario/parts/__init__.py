"""What a scenario can have: one file a part, with its keys, rules and cautions. Needs no JAX."""
