"""Files that drivers are read from: what is no policy is refused by name, and no code runs unasked."""

import json
import os
import zipfile

import numpy as np
import pytest

from agents.drivers import authority_entry, driver_entry
from shared_control_env.evaluation.fingerprint import fingerprint
from shared_control_env.learned.shipped import POLICIES

STORED = dict(np.load(POLICIES / "driver-0.npz"))
CARD = json.loads(str(STORED["card"]))


def card(**changes):
    return {"card": json.dumps({**CARD, **changes})}


WRONG = {
    "not a number": {"W0": STORED["W0"] * np.nan},
    "infinite": {"b0": STORED["b0"] + np.inf},
    "other inputs": {"W0": STORED["W0"][:, :5]},
    "other outputs": {"b2": STORED["b2"][:1], "W2": STORED["W2"][:1]},
    "layers that do not fit": {"W1": STORED["W1"][:7]},
    "biases that do not fit": {"b0": STORED["b0"][:3]},
    "a scalar": {"W0": np.array(1.0)},
    "texts": {"W0": STORED["W0"].astype(str)},
    "no layers": dict.fromkeys([name for name in STORED if name != "card"]),
    "no card": {"card": None},
    "a card of null": {"card": "null"},
    "a card of numbers": {"card": "[1]"},
    "a card that is cut": {"card": "{"},
    "shape of null": card(shape=None),
    "an unknown nonlinearity": card(shape={"hidden": "gelu", "squashed": False}),
    "a nonlinearity of another type": card(shape={"hidden": ["tanh"], "squashed": False}),
    "squashed by a text": card(shape={"hidden": "tanh", "squashed": "yes"}),
    "environments of another type": card(environments=5),
    "environments that are none": card(environments=["SharedControl/None-v1"]),
    "features of another type": card(features=None),
    "a task of another type": card(task=["driver"]),
    "an unknown task": card(task="pilot"),
    "another task": card(task="allocator"),
    "another history": card(history="4"),
}


@pytest.mark.parametrize("changes", WRONG.values(), ids=list(WRONG))
def test_what_is_no_policy_is_refused_by_name(changes, tmp_path):
    path = tmp_path / "p.npz"
    np.savez(path, **{name: value for name, value in {**STORED, **changes}.items() if value is not None})
    with pytest.raises(ValueError, match=r"p\.npz"):
        driver_entry(str(path))


@pytest.mark.parametrize("content", [b"", b"PK", b"\x93NUMPY"])
def test_what_is_no_archive_is_refused_by_name(content, tmp_path):
    (tmp_path / "p.npz").write_bytes(content)
    for entry in (driver_entry, authority_entry):
        with pytest.raises(ValueError, match=r"p\.npz"):
            entry(str(tmp_path / "p.npz"))


def test_a_model_runs_no_code_unless_trusted(tmp_path):
    cloudpickle = pytest.importorskip("cloudpickle")
    import base64

    class Intruder:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "ran"),)

    text = base64.b64encode(cloudpickle.dumps(Intruder())).decode()
    with zipfile.ZipFile(tmp_path / "m.zip", "w") as archive:
        archive.writestr("data", json.dumps({"policy_class": {":type:": "x", ":serialized:": text}}))
    with pytest.raises(ValueError, match=r"runs as it is read.*trusted=True"):
        driver_entry(str(tmp_path / "m.zip"))
    assert not (tmp_path / "ran").exists()


def test_a_model_trained_on_normalised_observations_is_refused(tmp_path):
    import gymnasium as gym
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from shared_control_env.vector.stable_baselines import StableBaselinesVecEnv

    def environments():
        made = gym.make_vec("SharedControl/TwoLane-v1", num_envs=4, threads=1, autoreset_mode="same_step")
        return StableBaselinesVecEnv(made)

    for wrap, refused in ((VecNormalize, True), (lambda env: env, False)):
        model = PPO("MlpPolicy", wrap(environments()), n_steps=64, device="cpu", seed=0)
        model.learn(256)
        model.save(tmp_path / "m.zip")
        if refused:
            with pytest.raises(ValueError, match="VecNormalize"):
                driver_entry(str(tmp_path / "m.zip"), trusted=True)
        else:
            assert driver_entry(str(tmp_path / "m.zip"), trusted=True).make is not None


def test_the_same_name_with_another_content_is_another_driver(tmp_path):
    path = tmp_path / "p.npz"
    np.savez(path, **STORED)
    before = fingerprint(driver_entry(str(path)).make)
    np.savez(path, **{**STORED, "b2": STORED["b2"] + 0.1})
    assert fingerprint(driver_entry(str(path)).make) != before
