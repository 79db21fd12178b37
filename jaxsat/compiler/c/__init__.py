"""Printer of a scalar program as C."""
