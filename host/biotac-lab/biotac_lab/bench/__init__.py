"""The benchmarks of `biotac-lab bench`, and the code they are compared with."""
