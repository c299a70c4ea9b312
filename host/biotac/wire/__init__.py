"""The wire protocol: generated messages, framing, the decoder, and batches of numbered frames."""
