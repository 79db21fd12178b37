"""A scalar program as machine code, by LLVM."""
