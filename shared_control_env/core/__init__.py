"""The model, compiled by numba: functions of arrays that do not depend on Gymnasium or highway-env."""
