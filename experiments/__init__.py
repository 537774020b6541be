"""Experiments: one file per figure or table of the paper, and the command that reproduces them all."""
