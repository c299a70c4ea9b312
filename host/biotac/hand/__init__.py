"""A board and the fingers on it: commands, streams, reconnection, and the Hand that programs use."""

import lazy_loader

__getattr__, __dir__, _ = lazy_loader.attach(__name__, ["aio"])  # so that biotac.aio is found without an import
