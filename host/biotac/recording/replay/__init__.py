"""A recording played back as a board: the stream, and answers to commands."""
