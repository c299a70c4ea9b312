"""A recording played back as a board: its stream, and answers to commands."""
