from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared_control_env.core.compile.jit import jit
from shared_control_env.core.faults import command as d
from shared_control_env.core.faults import perception
from shared_control_env.core.faults.kinds import CHANNEL, KINDS, RATE, addresses
from shared_control_env.core.parameters import DegradationParameters, Limits
from shared_control_env.core.records import FAULT_MEMORY, MAX_DELAY, SIGNALS, pack, record_dtype

LIMITS = Limits()
DT = 0.05
STEERING = {"steering": True}


@jit
def misperceive(t, faults, signals):
    perception.misperceive(t, faults, signals[()])


def fault_of(kind, **fields):
    """Parameters of a degradation of a kind, its compiled functions among them."""
    act, perceive, advance = addresses(KINDS[kind])
    in_unit = KINDS[kind].unit in (CHANNEL, RATE)
    return DegradationParameters(list(KINDS).index(kind), act, perceive, advance, in_unit_of_channel=in_unit, **fields)


def played(kind):
    """Where the profile of a kind that plays one lies."""
    return {"profile": PROFILE.ctypes.data, "profile_steps": len(PROFILE)} if KINDS[kind].recorded else {}


def faults_of(*entries):
    records = np.zeros(len(entries), record_dtype(DegradationParameters))
    for i, entry in enumerate(entries):
        records[i] = pack(entry)
    return records


def run(commands, *entries, limits=LIMITS):
    """Degraded commands of consecutive time steps, shape (n, 2)."""
    faults = faults_of(*entries)
    memories = np.zeros(len(faults), FAULT_MEMORY)
    out = np.empty((len(commands), 2))
    for k, command in enumerate(np.asarray(commands, dtype=float)):
        d.degrade(command, k, DT, faults, memories, limits, out[k])
    return out


def steering(kind, n=60, command=0.1, **fields):
    """Degraded steering of a constant or given command under one degradation."""
    commands = np.zeros((n, 2))
    commands[:, 1] = command
    return run(commands, fault_of(kind, **STEERING, **fields))[:, 1]


@pytest.mark.parametrize("k", range(45))
def test_case_1_is_the_printed_profile(k):
    printed = 0.0 if k < 10 else 0.3 * (k - 10) / 20 if k <= 30 else 0.3
    assert steering("bias", command=0.0, onset=0.5, ramp=1.0, size=0.3)[k] == pytest.approx(printed, abs=1e-12)


@pytest.mark.parametrize("k", range(20))
def test_case_2_is_the_printed_profile(k):
    printed = 0.0 if k <= 5 else 3.0 * (k - 5) / 5 if k <= 10 else 3.0
    fault = fault_of("bias", acceleration=True, onset=0.25, ramp=0.25, size=3.0)
    assert run(np.zeros((20, 2)), fault)[k, 0] == pytest.approx(printed, abs=1e-12)


def test_step_where_the_ramp_is_zero():
    fault = pack(fault_of("bias", onset=1.0))[()]
    assert [d.severity(fault, t) for t in (0.999, 1.0, 9.0)] == [0.0, 1.0, 1.0]


def test_it_is_gone_after_its_duration():
    out = steering("bias", command=0.0, onset=0.5, duration=1.0, size=0.2)
    np.testing.assert_allclose(out[:10], 0.0)
    np.testing.assert_allclose(out[10:30], 0.2)
    np.testing.assert_allclose(out[30:], 0.0)


def test_an_intermittent_one_comes_and_goes():
    out = steering("bias", n=50, command=0.0, onset=0.5, period=1.0, duty=0.4, size=0.2)
    on = np.abs(out - 0.2) < 1e-12
    np.testing.assert_array_equal(on[10:], np.tile([True] * 8 + [False] * 12, 2))


def test_faults_act_one_after_the_other_and_clip():
    entries = [fault_of("bias", acceleration=True, size=s) for s in (3.0, 4.0)]
    entries += [
        fault_of("bias", steering=True, size=0.1),
        fault_of("sign_error", steering=True),
    ]
    np.testing.assert_allclose(run([[1.0, 0.05]], *entries), [[5.0, -0.15]])


def test_no_fault_changes_nothing():
    np.testing.assert_array_equal(run([[-1.0, 0.2]]), [[-1.0, 0.2]])
    np.testing.assert_array_equal(run([[-1.0, 0.2]], DegradationParameters()), [[-1.0, 0.2]])


def test_loss_of_effectiveness_scales():
    np.testing.assert_allclose(steering("loss_of_effectiveness", size=0.75, onset=0.1)[[0, 5]], [0.1, 0.025])


def test_stuck_holds_the_command_of_its_onset():
    command = 0.005 * np.arange(60)
    out = steering("stuck", command=command, onset=0.5, duration=1.0)
    np.testing.assert_allclose(out[10:30], command[10])
    np.testing.assert_allclose(out[30:], command[30:])


def test_rate_limit_bounds_every_change():
    out = steering("rate_limit", command=0.3 * np.sign(np.sin(np.arange(60))), size=0.4, onset=0.3)
    assert np.abs(np.diff(out[6:])).max() <= 0.4 * DT + 1e-12
    assert np.abs(np.diff(out[:6])).max() > 0.1


def test_saturation_shrinks_the_range():
    assert steering("saturation", command=0.3, size=0.8)[5] == pytest.approx(0.2 * LIMITS.delta_max)
    assert steering("saturation", command=0.05, size=0.8)[5] == 0.05


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5, (MAX_DELAY - 1) * DT])
def test_delay_gives_the_command_of_before(delay):
    command = 0.2 * np.sin(0.3 * np.arange(60))
    out = steering("delay", command=command, size=delay, onset=1.5)
    steps = round(delay / DT)
    np.testing.assert_allclose(out[30:], command[30 - steps : 60 - steps])


def test_white_noise_is_white_and_has_its_size():
    noise = steering("white_noise", n=20000, command=0.0, size=0.05, seed=7)
    assert noise.std() == pytest.approx(0.05, rel=0.03)
    assert abs(noise.mean()) < 0.002
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.03
    assert (noise != steering("white_noise", n=20000, command=0.0, size=0.05, seed=8)).mean() > 0.99


def test_coloured_noise_has_its_correlation_time():
    noise = steering("coloured_noise", n=40000, command=0.0, size=0.05, time_constant=0.5, seed=3)
    assert noise.std() == pytest.approx(0.05, rel=0.1)
    for lag in (1, 5, 10):
        assert np.corrcoef(noise[lag:], noise[:-lag])[0, 1] == pytest.approx(np.exp(-lag * DT / 0.5), abs=0.06)


def test_oscillation_is_a_sine_from_the_onset():
    out = steering("oscillation", command=0.0, size=0.1, frequency=0.5, onset=0.5)
    np.testing.assert_allclose(out[10:], 0.1 * np.sin(np.pi * DT * np.arange(50)), atol=1e-12)


def test_drop_out_and_sign_error():
    assert steering("drop_out")[3] == 0.0
    assert steering("sign_error")[3] == -0.1


PROFILE = np.full(40, 0.1)


@pytest.mark.parametrize("kind", KINDS)
def test_only_its_own_channels_are_touched(kind):
    commands = np.sin(np.arange(80.0))[:, None] * [4.0, 0.4]
    for channel, field in enumerate(d.CHANNELS):
        out = run(commands, fault_of(kind, size=0.5, seed=1, **played(kind), **{field: True}))
        np.testing.assert_array_equal(out[:, 1 - channel], commands[:, 1 - channel])
        assert (kind in ("none", "lane_offset", "missed_lead")) == np.array_equal(out, commands)


def test_both_channels_take_the_same_share_of_their_limits():
    out = run(np.zeros((3, 2)), fault_of("bias", acceleration=True, steering=True, size=0.1))
    np.testing.assert_allclose(out / [LIMITS.a_max, LIMITS.delta_max], 0.1 / LIMITS.delta_max)


@given(
    kind=st.sampled_from(list(KINDS)[1:]),
    onset=st.floats(0.0, 2.0),
    ramp=st.floats(0.0, 1.0),
    duration=st.one_of(st.just(inf), st.floats(0.1, 2.0)),
    size=st.floats(0.0, 1.0),
    seed=st.integers(0, 2**31),
)
def test_before_and_after_it_the_command_is_untouched_and_always_within_limits(kind, onset, ramp, duration, size, seed):
    commands = np.sin(np.arange(100.0))[:, None] * [4.0, 0.4]
    timing = {"onset": onset, "ramp": ramp, "duration": duration}
    fault = fault_of(kind, acceleration=True, steering=True, size=size, seed=seed, **timing, **played(kind))
    out = run(commands, fault)
    t = DT * np.arange(100)
    outside = (t < onset) | (t >= onset + duration)
    np.testing.assert_array_equal(out[outside], commands[outside])
    assert (np.abs(out) <= [LIMITS.a_max, LIMITS.delta_max]).all()


def test_perception():
    faults = faults_of(
        fault_of("lane_offset", size=-1.5, onset=1.0, ramp=1.0),
        fault_of("missed_lead", onset=2.0, duration=1.0),
    )
    signals = np.zeros((), SIGNALS)
    for t, expected in ((0.5, (0.0, 0.0)), (1.5, (-0.75, 0.0)), (2.5, (-1.5, 1.0)), (3.5, (-1.5, 0.0))):
        misperceive(t, faults, signals)
        np.testing.assert_allclose(signals["misperception"], expected)


def test_an_episode_begins_with_nothing_remembered():
    memories = np.zeros(2, FAULT_MEMORY)
    memories.view(np.uint8)[:] = 1
    d.clear_faults(memories)
    for name in FAULT_MEMORY.names:
        assert not memories[name].any(), name
