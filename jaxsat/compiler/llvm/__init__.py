"""Printer of a scalar program as LLVM code, and its machine code."""
