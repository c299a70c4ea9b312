"""The generator behind tools/gen_protocol.py: one module per kind of output."""
