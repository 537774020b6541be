"""The risk does not depend on where the road lies, nor on left and right."""

import numpy as np
import pytest

from shared_control_env.core.parameters import DegradationParameters, Parameters
from shared_control_env.core.records import FAULT_MEMORY, SIGNALS, pack, record_dtype
from shared_control_env.core.world.road import PSI0, X0, Y0, point_at, reference_line
from tests import compiled
from tests.scenes import scene_of

PARAMETERS = pack(Parameters())
NO_FAULTS = np.empty(0, record_dtype(DegradationParameters)), np.empty(0, FAULT_MEMORY)


def risks(state, others, line, u):
    scene = scene_of(state, PARAMETERS, others, line)
    signals = np.zeros((), SIGNALS)
    signals["u_a_des"] = u
    compiled.monitor(scene, others, line, *NO_FAULTS, PARAMETERS, signals)
    return float(signals["r_x"]), float(signals["r_y"])


def situation(rng, kappa):
    line = reference_line([(200.0, kappa)], lead_in=50.0)
    x, y, psi = point_at(line, 0.0, rng.uniform(-1.5, 1.5))
    state = np.array([x, y, psi + rng.uniform(-0.1, 0.1), rng.uniform(5, 20), rng.uniform(-0.3, 0.3), 0.1])
    others = []
    for s, d in ((rng.uniform(6, 30), 0.0), (rng.uniform(5, 30), 4.0), (-rng.uniform(2, 20), 4.0)):
        x, y, psi = point_at(line, s, d)
        others.append([x, y, psi, rng.uniform(5, 20), rng.uniform(-1, 1), 0.0, 5.0, 2.0])
    return line, state, np.array(others), rng.uniform(-1, 1, 2) * [5.0, 0.4]


def moved(line, state, others, angle, shift):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    line, state, others = line.copy(), state.copy(), others.copy()
    line[:, [X0, Y0]] = line[:, [X0, Y0]] @ turn + shift
    line[:, PSI0] += angle
    state[:2] = state[:2] @ turn + shift
    state[2] += angle
    others[:, :2] = others[:, :2] @ turn + shift
    others[:, 2] += angle
    return line, state, others


@pytest.mark.parametrize("kappa", [0.0, 1 / 60, -1 / 80])
def test_rotation_and_translation(kappa):
    rng = np.random.default_rng(0)
    seen = []
    for _ in range(100):
        line, state, others, u = situation(rng, kappa)
        here = risks(state, others, line, u)
        there_line, there_state, there_others = moved(
            line, state, others, rng.uniform(-3, 3), rng.uniform(-500, 500, 2)
        )
        assert risks(there_state, there_others, there_line, u) == pytest.approx(here, abs=1e-8)
        seen.append(here)
    assert (np.ptp(seen, axis=0) > 0.3).all()  # the sample does cover both risks


@pytest.mark.parametrize("kappa", [0.0, 1 / 60])
def test_mirror(kappa):
    rng = np.random.default_rng(1)
    for _ in range(100):
        line, state, others, u = situation(rng, kappa)
        mirrored = reference_line([(200.0, -kappa)], lead_in=50.0)
        flipped = others * [1, -1, -1, 1, 1, -1, 1, 1]
        assert risks(state * [1, -1, -1, 1, -1, -1], flipped, mirrored, u * [1, -1]) == pytest.approx(
            risks(state, others, line, u), abs=1e-9
        )
