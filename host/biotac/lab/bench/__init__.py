"""The benchmarks of `biotac bench`, and the code they are compared with."""
