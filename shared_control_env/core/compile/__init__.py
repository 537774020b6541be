"""Numba's plumbing. Changing an equation needs none of it; docs/compiling.md says when one needs to know."""
