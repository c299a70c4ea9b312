"""Writing an image to a board and restoring the settings: ``biotac flash``."""

from __future__ import annotations

from .backup import Backup, Restored, read_backup
from .image import Image, read_image
from .interfaces import Loader, Target
from .procedure import Outcome, flash

__all__ = ["Backup", "Image", "Loader", "Outcome", "Restored", "Target", "flash", "read_backup", "read_image"]
