"""The Gauss-Newton solver against SciPy's SLSQP on the same cost, and a CasADi twin of the whole problem with IPOPT."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks.controllers import automation_cost, pose, roll_out_posed, solve_automation
from shared_control_env.core.control import automation
from shared_control_env.core.control.automation import AUTOMATIONS
from shared_control_env.core.parameters import Parameters
from shared_control_env.core.records import MAX_CONTROL, pack
from shared_control_env.core.world.road import reference_line
from tests.scenes import STRAIGHT, random_state, scene_of

VALUES = Parameters()
PARAMETERS = pack(VALUES)
SCALE = np.array([VALUES.limits.a_max, VALUES.limits.delta_max])
N_STATES = 200


def scenes(count=N_STATES, line=STRAIGHT):
    rng = np.random.default_rng(0)
    for _ in range(count):
        scene = scene_of(random_state(rng), PARAMETERS, line=line)
        scene["v_target"] = max(0.0, scene["z"][3] + rng.uniform(-4.0, 4.0))
        yield scene


def solve(scene, iterations, U=None):
    U = np.zeros((MAX_CONTROL, 2)) if U is None else U
    return U, solve_automation(U, scene, PARAMETERS, iterations, np.zeros((), AUTOMATIONS))


def slsqp(scene, start):
    work, U = np.zeros((), AUTOMATIONS), np.zeros((MAX_CONTROL, 2))

    def cost(x):
        U[:3] = x.reshape(3, 2) * SCALE
        return automation_cost(U, scene, PARAMETERS, work)

    options = {"ftol": 1e-13, "maxiter": 500}
    return minimize(cost, start, method="SLSQP", bounds=[(-1, 1)] * 6, options=options).fun


def gap(value, best):
    """Relative excess of a cost over the optimum; costs below 1e-6 count as 1e-6."""
    return (value - best) / max(best, 1e-6)


def test_cost_gap_to_slsqp_cold_and_warm():
    cold, warm = [], []
    for scene in scenes():
        best = min(slsqp(scene, np.zeros(6)), solve(scene, 100)[1][3])
        _, (status, _, _, value) = solve(scene, VALUES.solver.first_iterations)
        assert status != automation.FAILED
        cold.append(gap(value, best))
        # Warm: the solution of a state one step away, as in the loop.
        near = scene.copy()
        near["z"][1] += 0.02
        near["z"][3] += 0.05
        U, _ = solve(near, 20)
        warm.append(gap(solve(scene, 2, U)[1][3], best))
    assert np.percentile(cold, 95) <= 1e-2
    assert np.percentile(warm, 95) <= 1e-4


def casadi_problem():
    """The problem of Eq. 13 written anew in CasADi's symbols, on a straight lane."""
    p, w = VALUES.vehicle, VALUES.automation
    z0, v_target, U = ca.SX.sym("z", 6), ca.SX.sym("v"), ca.SX.sym("U", 2, w.H_c)
    dt, z, J = VALUES.task.dt, z0, 0
    for i in range(w.H_p):
        a, delta = U[0, min(i, w.H_c - 1)], U[1, min(i, w.H_c - 1)]
        v = ca.fmax(0, z[3] + dt * (a + z[5] * z[4]))
        new = ca.SX.sym("new", 2)
        F_f = -p.C_f * (new[0] + p.l_f * new[1] - delta * v)  # forces times v
        F_r = -p.C_r * (new[0] - p.l_r * new[1])
        lateral = ca.vertcat(
            v * new[0] - v * z[4] - dt * (-new[1] * v**2 + 2 * (F_f * ca.cos(delta) + F_r) / p.m),
            v * new[1] - v * z[5] - dt * (2 * (p.l_f * F_f - p.l_r * F_r) / p.I_z),
        )
        M = ca.jacobian(lateral, new)
        new = ca.solve(M, -ca.substitute(lateral, new, ca.SX.zeros(2)))
        x = z[0] + dt * (v * ca.cos(z[2]) - new[0] * ca.sin(z[2]))
        psi = z[2] + dt * new[1]
        y = z[1] + dt * (v * ca.sin(psi) + new[0] * ca.cos(psi))
        r_b = ca.fmax(0, 2.0 - ca.fabs(y))
        field = VALUES.lateral
        cut = field.d_c + field.v_w / 2
        P = ca.fmax(0, field.alpha_f * (ca.exp(-(r_b**2)) - np.exp(-(cut**2))))
        J += w.R * P**2 + w.W * y**2 + w.H * (v - v_target) ** 2 + w.N * ((new[1] - z[5]) / dt) ** 2
        z = ca.vertcat(x, y, psi, v, new[0], new[1])
    J += ca.sum2(w.Q_a * U[0, :] ** 2 + w.Q_delta * U[1, :] ** 2)
    problem = {"x": ca.vec(U), "f": J, "p": ca.vertcat(z0, v_target)}
    options = {"ipopt": {"print_level": 0, "tol": 1e-9}, "print_time": False, "error_on_fail": False}
    return ca.Function("J", [U, z0, v_target], [J]), ca.nlpsol("solver", "ipopt", problem, options)


def test_agrees_with_casadi_and_ipopt():
    J, solver = casadi_problem()
    bound = np.tile(SCALE, 3)
    gaps = []
    for scene in scenes():
        U, (_, _, _, value) = solve(scene, 100)
        twin = float(J(U[:3].T, scene["z"], scene["v_target"]))
        assert value == pytest.approx(twin, rel=1e-9, abs=1e-12)
        best = solver(x0=np.zeros(6), lbx=-bound, ubx=bound, p=np.r_[scene["z"], scene["v_target"]])
        gaps.append(gap(value, float(best["f"])))
    assert np.percentile(gaps, 95) <= 1e-4
    assert np.max(gaps) <= 1e-2


@pytest.mark.parametrize("line", [STRAIGHT, reference_line([(300.0, 1 / 60)], lead_in=50.0)])
def test_gradient_matches_finite_differences(line):
    rng = np.random.default_rng(1)
    work = np.zeros((), AUTOMATIONS)
    for scene in scenes(20, line):
        U = np.zeros((MAX_CONTROL, 2))
        U[:3] = rng.uniform(-0.3, 0.3, (3, 2)) * SCALE
        pose(U, scene.reshape(1), PARAMETERS.reshape(1), 0, work)
        roll_out_posed(True, scene.reshape(1), PARAMETERS.reshape(1), work)
        gradient = 2.0 * work["block"]["gradient"][:6, 0].copy()
        numeric = []
        for c in range(6):
            step = np.zeros((MAX_CONTROL, 2))
            step[c // 2, c % 2] = 1e-6
            costs = [automation_cost(U + sign * step, scene, PARAMETERS, work) for sign in (1, -1)]
            numeric.append((costs[0] - costs[1]) / 2e-6)
        np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-5)


def test_respects_the_bounds_and_reports_stationarity():
    scene = scene_of(np.array([0.0, 1.5, 0.0, 25.0, 0.0, 0.0]), PARAMETERS)
    scene["v_target"] = 0.0
    U, (status, _, residual, _) = solve(scene, 100)
    assert status == automation.CONVERGED
    assert residual <= automation.TOLERANCE
    assert np.abs(U / SCALE).max() <= 1.0 + 1e-12
    assert U[2, 0] == pytest.approx(-5.0)


def test_starts_off_from_standstill():
    scene = scene_of(np.zeros(6), PARAMETERS)
    U, _ = solve(scene, 5)
    assert U[0, 0] > 1.0


def test_not_a_number_is_reported():
    scene = scene_of(np.zeros(6), PARAMETERS)
    scene["z"][1] = np.nan
    assert solve(scene, 5)[1][0] == automation.FAILED
