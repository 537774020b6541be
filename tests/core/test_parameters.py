import inspect

import numpy as np
import pytest

from shared_control_env.core import parameters as p
from shared_control_env.core.records import pack, record_dtype

CLASSES = [value for value in vars(p).values() if isinstance(value, type) and hasattr(value, "_fields")]


@pytest.mark.parametrize("cls", CLASSES)
def test_every_parameter_is_documented(cls):
    attributes = inspect.getdoc(cls).split("Attributes:")[1]  # without the indentation, which Python 3.13 takes away
    for field in cls._fields:
        assert f"    {field}: " in attributes or f" {field}, " in attributes, f"{cls.__name__}.{field}"


@pytest.mark.parametrize("cls", [c for c in CLASSES if c is not p.Parameters])
def test_every_parameter_names_its_source(cls):
    assert "paper" in cls.__doc__ or "ours" in cls.__doc__


def test_paper_tables():
    vehicle, field = p.VehicleParameters(), p.LongitudinalRiskParameters()
    assert (vehicle.m, vehicle.I_z, vehicle.l_f, vehicle.l_r) == (2000.0, 1300.0, 1.21, 1.05)
    assert (field.w_f, field.w_l, field.w_p) == (0.1, 0.2, 0.7)
    average = np.mean(list(p.IDENTIFIED_DRIVERS.values())[:5], axis=0)
    np.testing.assert_allclose(p.IDENTIFIED_DRIVERS["average"], average, atol=0.006)


def test_pack_keeps_every_value():
    values = p.Parameters(task=p.TaskParameters(dt=0.1), longitudinal=p.LongitudinalRiskParameters(graded=False))
    record = pack(values)
    assert record.dtype == record_dtype(p.Parameters)
    for section in p.Parameters._fields:
        for name, value in getattr(values, section)._asdict().items():
            np.testing.assert_array_equal(record[section][name], value)
