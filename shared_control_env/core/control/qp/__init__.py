"""Solvers of the controllers' quadratic programs."""
