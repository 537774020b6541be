"""Allocators that look at what a command leads to: their rules by hand, their limits, and the kernel against Python."""

from math import exp, inf

import numpy as np
import pytest

from shared_control_env.controllers.allocators import Allocation, checked_allocation, hide
from shared_control_env.controllers.disagreement import Guardian, IntentAuthority, ResidualAuthority
from shared_control_env.controllers.safety import BarrierAuthority, PredictiveFilter, SafeHIL
from shared_control_env.core.authority import barrier
from shared_control_env.core.authority.safehil import authority_of_growth
from shared_control_env.core.records import SCENE, SIGNALS
from shared_control_env.envs import LaneKeepingEnv, TwoLaneEnv
from shared_control_env.envs.environments import environment_class
from shared_control_env.envs.scenarios import SCENARIOS
from shared_control_env.vector.environment import SharedControlVectorEnv
from shared_control_env.wrappers import AuthorityLimiter, DriverModel

COMPILED = (SafeHIL, lambda: SafeHIL(growing=True), BarrierAuthority, PredictiveFilter)
PROPORTIONAL = {"authority": {"law": "proportional"}}
BIASED = {**PROPORTIONAL, "degradations": [], "faults": [{"kind": "bias", "onset": 0.5, "size": 0.3}]}


def test_safehil_by_hand():
    assert authority_of_growth(0.0, 0.0) == 0.0
    assert authority_of_growth(0.2, 0.05) == 0.0
    assert authority_of_growth(0.0, 0.09) == 0.0  # negligible
    assert authority_of_growth(0.3, 0.3) == 0.0
    assert authority_of_growth(0.1, 0.4) == pytest.approx(exp(4.0) / (exp(1.0) + exp(4.0)))
    values = [authority_of_growth(0.1, r_h) for r_h in np.linspace(0.11, 1.0, 50)]
    assert (np.diff(values) > 0.0).all()


@pytest.mark.parametrize(
    ("u_f", "u_h", "low", "high", "alpha"),
    [
        (0.2, 0.0, -0.1, 0.3, 1.0),  # allowed
        (0.2, 0.0, -0.1, 0.1, 0.5),
        (0.2, -0.1, -0.1, 0.1, 1.0),  # the driver makes room
        (-0.2, 0.0, -0.05, 0.1, 0.25),
        (0.2, 0.3, -0.1, 0.1, 0.0),  # nothing of it helps
        (-3.0, 0.0, -inf, -5.0, 1.0),  # brakes too little: all of it
        (3.0, 0.0, -inf, -5.0, 0.0),
        (0.0, 0.0, -inf, -5.0, 1.0),
        (0.2, 0.0, 0.3, -0.1, 0.5),  # rows that contradict each other: their mean
    ],
)
def test_largest_share(u_f, u_h, low, high, alpha):
    assert barrier.largest_share(u_f, u_h, low, high) == pytest.approx(alpha)


def at(env_class, **ego):
    """A limited environment after its reset, with a state of the ego."""
    env = env_class({**PROPORTIONAL, "degradations": [], "randomise": [], "faults": []})
    env.reset(seed=0)
    return env


def test_the_barrier_rows_hold_to_first_order():
    """The steering angle at a bound gives the lateral acceleration that the row allows, by the forces of Eq. 11."""
    env = at(TwoLaneEnv)
    state = np.array([0.0, 0.3, 0.02, 15.0, 0.0, 0.0])
    env.vehicle.array[:] = state
    env.step({"driver": np.zeros(2), "authority": np.ones(1)})
    scene, p = env.scene, env.parameters
    low, high = bounds(scene, p)
    assert low < high
    z = scene["z"].copy()
    rate = z[3] * np.sin(z[2]) + z[4] * np.cos(z[2])
    for bound, side in ((high, 1.0), (low, -1.0)):
        h = 2.0 - 1.0 - side * z[1]
        K_f, K_r, m = (2.0 * float(p["model"][name]) for name in ("C_f", "C_r", "m"))
        force = K_f * (bound - (z[4] + float(p["model"]["l_f"]) * z[5]) / z[3])
        force -= K_r * (z[4] - float(p["model"]["l_r"]) * z[5]) / z[3]
        allowed = barrier.growth_bound(h, side * z[1], side * rate)
        assert side * np.cos(z[2]) * force / (0.5 * m) == pytest.approx(allowed, abs=1e-9)


def test_the_row_holds_a_drift_below_its_bound():
    """Along the row with equality the lateral speed approaches its bound from both sides, and never passes it."""
    for w in (0.0, 0.6):
        h, speeds = 1.0, []
        for _ in range(400):
            w += 0.01 * barrier.growth_bound(h, 1.0 - h, w)
            h -= 0.01 * w
            speeds.append(w - barrier.DRIFT_RATE * h)
        assert abs(speeds[-1]) < 1e-3
        assert h > 0.0
    assert barrier.growth_bound(1.3, -0.3, 0.5) > barrier.growth_bound(1.0, 0.0, 0.5)  # on the way back it may be fast


def bounds(scene, p):
    from shared_control_env.core.compile.jit import jit

    @jit
    def steering(s, parameters):
        return barrier.steering_bounds(s[()], parameters[()])

    return steering(scene.reshape(()), p.reshape(()))


def test_the_gap_row():
    from shared_control_env.core.compile.jit import jit

    @jit
    def bound(s):
        return barrier.acceleration_bound(s[()])

    scene = np.zeros((), SCENE)
    assert bound(scene) == inf
    scene["neighbours"][2] = [1.0, 30.0, 0.0, 10.0, 0.0]
    scene["bodies"], scene["z"][3] = 5.0, 12.0
    surplus = 25.0 - barrier.GAP_AT_REST - barrier.HEADWAY * 12.0
    assert bound(scene) == pytest.approx((10.0 - 12.0 + barrier.GAP_RATE * surplus) / barrier.HEADWAY)


@pytest.mark.parametrize("make", COMPILED)
@pytest.mark.parametrize("name", ["lane_change", "curve_with_lead"])
def test_python_and_kernel_decide_the_same(make, name):
    single = AuthorityLimiter(environment_class(name)(BIASED), make())
    many = SharedControlVectorEnv(SCENARIOS[name], 1, config=BIASED, limiter=make())
    single.reset(seed=3)
    many.reset(seed=[3])
    for k in range(60):
        action = np.array([0.1, 0.05 * np.sin(0.3 * k)], dtype=np.float32)
        _, _, ended, _, info = single.step(action)
        infos = many.step(action[None])[4]
        np.testing.assert_array_equal(info["alpha"], infos["alpha"][0])
        assert ((info["alpha"] >= 0.0) & (info["alpha"] <= 1.0)).all()
        if ended:
            break


@pytest.mark.parametrize("make", [BarrierAuthority, PredictiveFilter, ResidualAuthority, Guardian])
def test_a_sound_automation_keeps_its_authority(make):
    env = DriverModel(AuthorityLimiter(LaneKeepingEnv({**PROPORTIONAL, "degradations": ["none"]}), make()))
    env.reset(seed=1)
    alphas = [env.step(0)[4]["alpha"] for _ in range(150)]
    assert np.mean(alphas) > 0.97


@pytest.mark.parametrize("make", [BarrierAuthority, PredictiveFilter, ResidualAuthority, IntentAuthority, Guardian])
def test_a_runaway_loses_its_steering_but_not_its_brake(make):
    env = DriverModel(AuthorityLimiter(TwoLaneEnv(BIASED), make()))
    env.reset(seed=0)
    alphas = np.array([env.step(0)[4]["alpha"] for _ in range(40)])
    assert alphas[12:, 1].min() < 0.5
    if make is not PredictiveFilter:  # which has one authority for both
        assert alphas[12:20, 0].min() > 0.9


def test_the_filter_takes_less_the_larger_the_bias():
    smallest = []
    for size in (0.0, 0.2, 0.5):
        faults = [{"kind": "bias", "onset": 0.5, "size": size}]
        env = DriverModel(AuthorityLimiter(TwoLaneEnv({**PROPORTIONAL, "faults": faults}), PredictiveFilter()))
        env.reset(seed=0)
        smallest.append(min(env.step(0)[4]["alpha_a"] for _ in range(30)))
    assert smallest[0] == 1.0
    assert smallest[1] < 0.5
    assert smallest[2] <= smallest[1]


def test_intent_by_hand():
    intent, signals = IntentAuthority(0.8, 0.95), np.zeros((), SIGNALS)
    signals["u_a_f"] = [0.5, np.radians(30.0) * 0.125]
    np.testing.assert_allclose(intent.allocate(np.zeros((), SCENE), signals), [2.0 / 3.0, 0.5])
    for wrong in ((0.9, 0.8), (-0.1, 0.5), (0.5, 1.1)):
        with pytest.raises(ValueError, match="must satisfy"):
            IntentAuthority(*wrong)


def test_the_residual_adds_up_and_calls():
    residual, scene, signals = ResidualAuthority(), np.zeros((), SCENE), np.zeros((), SIGNALS)
    scene["z"][3] = scene["v_target"] = 15.0
    seen = []
    for k in range(100):
        scene["t"], signals["u_a_f"] = 0.05 * k, [0.0, 0.1 if 20 <= k < 40 else 0.0]
        seen.append(residual.allocate(scene, signals))
    alphas, alerts = np.array([each.alpha for each in seen]), [each.alert for each in seen]
    assert (alphas[:, 0] == 1.0).all()
    assert (alphas[:20] == 1.0).all()
    assert alphas[30, 1] == 0.0
    assert (alphas[-1] == 1.0).all()  # forgets once the disagreement is over
    assert alerts[:20] == ["none"] * 20
    assert 20 < alerts.index("tactile") < 30
    with pytest.raises(ValueError, match="threshold"):
        ResidualAuthority(threshold=0.0)


def test_the_residual_has_few_false_alarms():
    """The stated rate: at most one alarm an hour without a fault. 60 episodes are ten minutes."""
    from shared_control_env.evaluation import Suite, evaluate
    from shared_control_env.evaluation.catalogue import SUITES

    table = evaluate("hands_on", "residual", Suite("sound", SUITES["full"].scenarios, ("none",)), seeds=range(50, 56))
    assert (table["false_alert"] > 0.0).sum() <= 1


def test_what_an_allocator_must_not_know():
    seen = []

    class Curious:
        def reset(self, seed=None):
            pass

        def allocate(self, scene, signals):
            seen.append(signals.copy())
            return 1.0

    class Needy(Curious):
        needs_u_a_des = True

    for make, hidden in ((Curious, True), (Needy, False)):
        env = DriverModel(AuthorityLimiter(TwoLaneEnv(BIASED), make()))
        env.reset(seed=0)
        seen.clear()
        commands = [env.step(0)[4]["u_h_act"] for _ in range(20)]
        assert np.isnan([each["fault"] for each in seen]).all()
        assert np.isnan([each["misperception"] for each in seen]).all()
        assert np.isnan([each["u_a_des"] for each in seen]).all() == hidden
        np.testing.assert_array_equal([each["u_h_act"] for each in seen], commands)  # the present one
        assert np.isfinite([each["u_a_f"] for each in seen]).all()


def test_an_allocator_may_ask_for_the_risks_of_any_command():
    class Asking:
        needs_assess = True

        def reset(self, seed=None):
            self.told = []

        def allocate(self, scene, signals, assess):
            same = assess(signals["u_a_f"])
            self.told.append((same, (float(signals["r_x"]), float(signals["r_y"]))))
            self.told.append((assess([0.0, 0.3])[1], assess([0.0, 0.0], horizon=0.0)[1]))
            return 1.0

    asking = Asking()
    env = DriverModel(AuthorityLimiter(TwoLaneEnv(BIASED), asking))
    env.reset(seed=0)
    for _ in range(5):
        env.step(0)
    assert all(one == other for one, other in asking.told[::2])  # and the signals of the step are not changed by it
    assert all(steered > now for steered, now in asking.told[1::2])


@pytest.mark.parametrize(
    ("given", "alphas", "alert"),
    [
        (0.5, (0.5, 0.5), 0),
        (np.float32(0.25), (0.25, 0.25), 0),
        ([0.1, 0.9], (0.1, 0.9), 0),
        (Allocation(0.5, "tactile"), (0.5, 0.5), 2),
        (Allocation((0.2, 0.3), "visual"), (0.2, 0.3), 1),
    ],
)
def test_what_an_allocator_may_return(given, alphas, alert):
    found, told = checked_allocation(given)
    np.testing.assert_allclose(found, alphas, rtol=1e-7)
    assert told == alert


@pytest.mark.parametrize(
    "given", [None, "half", np.nan, [0.1, 0.2, 0.3], Allocation(0.5, "loud"), Allocation([np.inf, 1])]
)
def test_what_it_may_not(given):
    with pytest.raises(ValueError, match="allocate\\(\\) gave"):
        checked_allocation(given)


def test_two_authorities_are_taken_as_an_action():
    env = TwoLaneEnv({**PROPORTIONAL, "faults": []})
    env.reset(seed=0)
    info = env.step({"driver": np.zeros(2), "authority": np.array([0.2, 0.7])})[4]
    np.testing.assert_allclose(info["u_a_act"], [0.2, 0.7] * info["u_a_f"])
    assert info["alpha_a"] == 0.2
    many = SharedControlVectorEnv(SCENARIOS["two_lane"], 2, config=PROPORTIONAL, limiter=False)
    many.reset(seed=0)
    infos = many.step({"driver": np.zeros((2, 2)), "authority": np.array([[0.2, 0.7], [1.0, 0.5]])})[4]
    np.testing.assert_allclose(infos["alpha"], [[0.2, 0.7], [1.0, 0.5]])
    with pytest.raises(ValueError, match="authority"):
        many.step({"driver": np.zeros((2, 2)), "authority": np.zeros((2, 3))})


def test_hidden_fields_do_not_touch_the_original():
    signals = np.zeros(2, SIGNALS)
    copy = signals.copy()
    hide(copy, BarrierAuthority())
    assert np.isnan(copy["u_a_des"]).all()
    assert (signals["u_a_des"] == 0.0).all()


@pytest.mark.parametrize(("alert", "within"), [("tactile", 0.05), ("visual", 1.0), ("none", inf)])
def test_an_alert_brings_the_person_back(alert, within):
    """Hands at rest under a sound automation: nothing but the alert is noticed."""

    class Calling:
        def reset(self, seed=None):
            pass

        def allocate(self, scene, signals):
            return Allocation(1.0, alert if scene["t"] >= 1.0 else "none")

    config = {
        **PROPORTIONAL,
        "faults": [],
        "internal_model": {"active": True},
        "person": {"active": True, "engaged": False},
    }
    env = DriverModel(AuthorityLimiter(TwoLaneEnv(config), Calling()))
    env.reset(seed=0)
    noticed = [env.step(0)[4]["driver"]["noticed"] for _ in range(80)][-1]
    assert noticed == (inf if alert == "none" else pytest.approx(1.0 + within, abs=0.051))
