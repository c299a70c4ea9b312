"""A board and its fingers: commands, streams, reconnection, and the Hand that programs use."""
