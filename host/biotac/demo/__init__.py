"""`biotac demo`: the whole chain in one run, and the answers to compare it with."""
