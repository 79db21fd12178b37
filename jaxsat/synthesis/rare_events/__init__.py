"""Probabilities of violating a requirement, however small."""
