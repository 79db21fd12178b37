"""Sets that provably contain every flight of a sampled loop: affine forms, rounded outward."""
