"""What is made of a linked firmware image, and what is checked on it."""
