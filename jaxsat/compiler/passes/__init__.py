"""Optimisation passes of scalar programs."""
