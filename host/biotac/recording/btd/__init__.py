"""SynTouch's own files: reading them, and making recordings of them."""
