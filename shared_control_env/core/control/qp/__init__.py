"""Solvers for the quadratic programs of the controllers."""
