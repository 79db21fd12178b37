"""Flight code: the controller of a sampled loop as C99, with test vectors and build files."""
