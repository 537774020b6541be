"""Compilation by numba: decorators, disk cache, calls by address and cold start.

Changing an equation requires no knowledge of this package; docs/compiling.md says when it is needed.
"""
