"""The compile cache is never wrong and never in the way."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shared_control_env.core.compile import cache, jit

ROOT = Path(__file__).parent.parent.parent

PROBE = """
import sys, types
package = types.ModuleType("shared_control_env"); package.__path__ = [sys.argv[1]]; sys.modules["shared_control_env"] = package
import numpy as np
from shared_control_env.core.control import driver_lag
from shared_control_env.core.parameters import DriverLagParameters
if len(sys.argv) > 2: print("ready", flush=True); input()
u = np.array([1.0, 0.0]); driver_lag.advance_lag(u, np.ones(2), np.zeros(2), 0.05, DriverLagParameters()); print(u[0])
"""
OLD, NEW = "u_h_act[i] = phi * u_h_act[i]", "u_h_act[i] = 2.0 * phi * u_h_act[i]"


@pytest.fixture
def sources(tmp_path):
    """The package's sources, without a cache."""
    folder = tmp_path / "shared_control_env"
    shutil.copytree(ROOT / "shared_control_env", folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def environment(folder, **more):
    kept = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT")}
    return {**kept, "NUMBA_CACHE_DIR": str(folder.parent / "cache"), **more}


def probe(folder, **more):
    command = [sys.executable, "-B", "-c", PROBE, str(folder)]
    result = subprocess.run(command, capture_output=True, text=True, env=environment(folder, **more), cwd=folder.parent)
    assert result.returncode == 0, result.stderr
    return float(result.stdout), result.stderr


def edit(folder):
    path = folder / "core/control/driver_lag.py"
    text = path.read_text()
    assert OLD in text
    path.write_text(text.replace(OLD, NEW))


def data_files(folder):
    return sorted((folder.parent / "cache").rglob("driver_lag.advance_lag*.nbc"))


def test_a_changed_equation_is_seen_and_the_old_one_found_again(sources):
    before, _ = probe(sources)
    edit(sources)
    after, _ = probe(sources)
    assert after - before == pytest.approx(np.exp(-0.25))
    path = sources / "core/control/driver_lag.py"
    path.write_text(path.read_text().replace(NEW, OLD))
    again, said = probe(sources)
    assert (again, said) == (before, "")  # from the cache of the old sources


def test_a_process_of_old_sources_does_not_spoil_the_cache_of_new_ones(sources):
    command = [sys.executable, "-B", "-c", PROBE, str(sources), "wait"]
    pipe = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    with subprocess.Popen(command, env=environment(sources), cwd=sources.parent, **pipe) as old:
        assert old.stdout.readline() == "ready\n"
        edit(sources)
        probe(sources)
        shutil.rmtree(sources.parent / "cache")
        old_number = float(old.communicate("\n")[0])
    new_number, _ = probe(sources)
    assert new_number - old_number == pytest.approx(np.exp(-0.25))


@pytest.mark.parametrize(
    "damage", [lambda b: b"", lambda b: b[:-20], lambda b: b[:200] + bytes([b[200] ^ 255]) + b[201:]]
)
def test_damaged_files_are_compiled_anew(sources, damage):
    number, _ = probe(sources)
    files = data_files(sources)
    assert files
    for path in files:
        path.write_bytes(damage(path.read_bytes()))
    again, said = probe(sources)
    assert again == number
    assert "is damaged" in said
    assert probe(sources) == (number, "")


def test_a_damaged_index_is_made_anew(sources):
    number, _ = probe(sources)
    for path in (sources.parent / "cache").rglob("*.nbi"):
        path.write_bytes(b"\x80\x05garbage")
    assert probe(sources)[0] == number
    assert probe(sources) == (number, "")


def test_where_nothing_can_be_written_it_runs_and_says_so_in_a_line(sources):
    wrong = sources.parent / "file"
    wrong.write_text("in the way")
    for path in sources.rglob("*"):
        if path.is_dir():
            (path / "__pycache__").write_text("in the way")
    _, said = probe(sources, NUMBA_CACHE_DIR=str(wrong / "cache"), HOME=str(wrong), XDG_CACHE_HOME=str(wrong / "x"))
    assert said.count("set NUMBA_CACHE_DIR to a folder that can be written to") == 1


def test_a_full_disk_is_said_once(monkeypatch, capsys):
    def full(self, signature, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("numba.core.caching.Cache.save_overload", full)
    cache.say_once.cache_clear()

    @jit.jit
    def doubled(x):
        return 2.0 * x

    assert doubled(2.0) == 4.0
    assert capsys.readouterr().err.count("No space left on device") == 1


def test_the_last_used_folders_are_kept(tmp_path):
    folders = [tmp_path / f"shared_control_env-{i}" for i in range(12)]
    for i, folder in enumerate(folders):
        folder.mkdir()
        os.utime(folder, (1000 * i, 1000 * i))
    cache._tidy(folders[0])  # the oldest, used now
    assert [folder.exists() for folder in folders] == [True, *[False] * 4, *[True] * 7]


INTERPRETED = """
import pickle, sys
import numpy as np, gymnasium as gym, shared_control_env
traces = []
for name in ("TwoLane", "LaneChange", "DenseTraffic"):
    env = gym.make(f"SharedControl/{name}-v1", config={"authority": {"law": "proportional"}})
    rng = np.random.default_rng(0)
    traces += [env.reset(seed=2)[1], *(env.step(rng.uniform(-0.3, 0.3, 2))[4] for _ in range(40))]
pickle.dump(traces, open(sys.argv[1], "wb"))
"""


def test_the_core_as_python_gives_what_the_compiled_one_gives(tmp_path):
    import pickle

    found = []
    for name, more in (("compiled", {}), ("python", {"NUMBA_DISABLE_JIT": "1"})):
        command = [sys.executable, "-c", INTERPRETED, str(tmp_path / name)]
        result = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **more}, cwd=ROOT)
        assert result.returncode == 0, result.stderr
        assert ("NUMBA_DISABLE_JIT is set" in result.stderr) == bool(more)
        found.append(pickle.loads((tmp_path / name).read_bytes()))
    for compiled, interpreted in zip(*found, strict=True):
        for key, value in compiled.items():
            if not isinstance(value, dict):
                np.testing.assert_allclose(interpreted[key], value, atol=1e-10, err_msg=key)


def test_the_kernel_as_python_is_refused():
    code = "import gymnasium as gym, shared_control_env; gym.make_vec('SharedControl/TwoLane-v1', num_envs=2)"
    result = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=ROOT,
    )
    assert result.returncode == 1
    assert "NUMBA_DISABLE_JIT is set, and the vectorised environment" in result.stderr.splitlines()[-1]
