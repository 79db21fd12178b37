"""Foundations of all subpackages: numbers, attitude, noise, checks, errors and declarations."""
