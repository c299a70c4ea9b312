"""The wire: generated messages, framing, the decoder, and batches of numbered frames."""
