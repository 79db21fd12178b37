"""A scalar program as C."""
