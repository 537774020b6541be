"""Experiments: one file for each figure or table of the paper, and the command that reproduces all of them."""
