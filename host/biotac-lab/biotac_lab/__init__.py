"""The papers' experiments, learnt features, trained maps and benchmarks, on biotac's public names alone."""
