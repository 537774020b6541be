"""Base of drivers and allocators that keep nothing from one step to the next."""

from __future__ import annotations


class Stateless:
    """A driver or allocator without state. It draws no random numbers."""

    def reset(self, seed: int | None = None) -> None:
        """Do nothing, since there is no state to reset.

        Args:
            seed: not used.
        """
