"""The model as array functions compiled by numba; needs neither gymnasium nor highway-env."""
