"""A board and its fingers: commands, streams, reconnection, and what a program sees of them."""
