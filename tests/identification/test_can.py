"""A CAN record: on a made-up car whose delay is known, and on the shared one where it is there."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from shared_control_env.cli import app
from shared_control_env.identification.can import SIGNALS, read_record, study

SHARED = Path(__file__).parents[3] / "shared/data/comma2k19_can.npz"


def record(path, delay=0.06, push=0.0, **changes):
    """30 s, of which the automation steers 20; the motor follows the command after a delay."""
    rng, t = np.random.default_rng(0), np.arange(0.0, 30.0, 0.01)
    command = np.convolve(rng.normal(size=len(t)), np.ones(20) / 20, mode="same") * 300.0
    request = (t >= 10.0).astype(float)
    arrays = {
        "t_command": t,
        "command": command * request,
        "request": request,
        "t_torque": t,
        "driver_torque": np.full_like(t, 5.0) - push * np.sign(np.interp(t - delay, t, command)) * (t > 20.0),
        "motor_torque": np.interp(t - delay, t, command * request),
        "t_speed": t,
        "speed": np.full_like(t, 20.0),
        "t_angle": t,
        "wheel_angle": np.zeros_like(t),
        **changes,
    }
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


def test_delay_and_conflict_are_found(tmp_path):
    found = study(read_record(record(tmp_path / "r.npz", push=200.0)))
    assert found.delay == pytest.approx(0.06, abs=0.011)
    assert found.correlation > 0.98
    assert found.engaged == pytest.approx(2.0 / 3.0, abs=0.01)
    assert found.by_hand == pytest.approx(10.0, abs=0.1)
    assert found.pushing == pytest.approx(0.5, abs=0.02)
    assert found.conflict > 0.95
    quiet = study(read_record(record(tmp_path / "q.npz")))
    assert quiet.pushing == 0.0
    assert np.isnan(quiet.conflict)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"motor_torque": None}, "has no 'motor_torque'"),
        ({"t_speed": None}, "has no 't_speed'"),
        ({"speed": np.zeros(5)}, "has 5 values and 3000 time stamps"),
        ({"speed": np.full(3000, np.nan)}, "finite"),
        ({"t_speed": np.arange(3000)[::-1]}, "do not increase"),
    ],
)
def test_wrong_records(tmp_path, changes, said):
    with pytest.raises(ValueError, match=said):
        read_record(record(tmp_path / "r.npz", **changes))


def test_a_record_without_automation_and_one_that_is_none(tmp_path):
    with pytest.raises(ValueError, match=r"steers for 0.0 s"):
        study(read_record(record(tmp_path / "r.npz", request=np.zeros(3000))))
    (tmp_path / "x.npz").write_bytes(b"no")
    with pytest.raises(ValueError, match="no record of arrays"):
        read_record(tmp_path / "x.npz")


def test_what_gives_no_delay_is_said_and_a_sign_does_not_matter(tmp_path):
    with pytest.raises(ValueError, match="'command' is constant"):
        study(read_record(record(tmp_path / "c.npz", command=np.full(3000, 5.0))))
    turned = -np.load(record(tmp_path / "a.npz"))["motor_torque"]
    found = study(read_record(record(tmp_path / "t.npz", motor_torque=turned)))
    assert found.delay == pytest.approx(0.06, abs=0.011)
    assert found.correlation < -0.98
    with pytest.raises(ValueError, match="end of the search"):
        study(read_record(record(tmp_path / "l.npz", delay=0.55)))


def test_the_shared_record_and_its_honest_words():
    if not SHARED.exists():
        pytest.skip(f"needs {SHARED.name} in ../shared/data")
    assert set(np.load(SHARED).files) == {*SIGNALS, *(stamps for stamps, _ in SIGNALS.values())}
    found = study(read_record(SHARED))
    assert found.delay == pytest.approx(0.02, abs=0.011)
    assert found.correlation == pytest.approx(0.97, abs=0.01)
    assert found.by_hand == pytest.approx(9.0, abs=0.2)
    result = CliRunner().invoke(app, ["identify", str(SHARED)], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    assert "K_h and T_h are not identified from this record" in result.output
    for option in (["--channel", "acceleration"], ["--condition", "x"], ["--out", "x"]):
        assert CliRunner().invoke(app, ["identify", str(SHARED), *option]).exit_code == 2
