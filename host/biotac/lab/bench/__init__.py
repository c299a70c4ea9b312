"""What `biotac bench` measures, with the contestants beside it."""
