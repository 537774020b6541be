"""The model, compiled by numba: array functions that know neither Gymnasium nor highway-env."""
