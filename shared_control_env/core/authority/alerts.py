"""What an allocator may tell the driver beside alpha_a."""

from __future__ import annotations

ALERTS = ("none", "visual", "tactile")
"""Names of the alerts; the index of an alert is its code."""

NO_ALERT, VISUAL, TACTILE = range(3)
