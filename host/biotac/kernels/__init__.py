"""Below everything that computes: the finger's shape, and the compiled core's kernels for arrays."""
