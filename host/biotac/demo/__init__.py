"""`biotac demo`: the whole chain in one run, and what it is compared with."""
