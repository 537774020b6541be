"""Trained policies as drivers and allocators: what they see, and what they do with it; NumPy alone."""
