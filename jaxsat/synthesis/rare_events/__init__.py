"""Probabilities, however small, of violating a requirement."""
