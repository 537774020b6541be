import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    source = tmp_path_factory.mktemp("source") / "tree"
    # Only what git knows, as a release would be built from.
    subprocess.run(["git", "clone", "-q", str(ROOT), str(source)], check=True)
    out = source / "dist"
    # The source distribution first, and the wheel from that alone.
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(source)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    (path,) = out.glob("*.whl")
    return path


def test_wheel_holds_the_package_alone(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"shared_control_env"}
    assert "shared_control_env/py.typed" in names
    assert any(name.endswith("LICENSE") for name in names)


def test_wheel_runs_from_a_read_only_folder(wheel, tmp_path):
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    for path in [*site.rglob("*"), site]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from shared_control_env.core.world.road import wrap_angle\n"
        "import shared_control_env\n"
        "assert shared_control_env.__file__.startswith(sys.argv[1])\n"
        "assert wrap_angle(4.0) < 0.0\n"
        "import gymnasium as gym\n"
        "for name in ('TwoLane', 'Recorded'):\n"
        "    env = gym.make(f'SharedControl/{name}-v1'); env.reset(seed=0); env.step(env.action_space.sample())\n"
        "from shared_control_env.learned.shipped import learned_driver; learned_driver()\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    subprocess.run([sys.executable, "-c", code, str(site)], check=True, cwd=tmp_path, env=environment)
    for path in [site, *site.rglob("*")]:
        path.chmod(0o755 if path.is_dir() else 0o644)


def test_base_install_needs_no_training_or_plotting_package():
    code = (
        "import sys, gymnasium as gym, shared_control_env\n"
        "env = gym.make('SharedControl/TwoLane-v1'); env.reset(seed=0)\n"
        "print([m for m in ('torch', 'stable_baselines3', 'matplotlib.pyplot', 'casadi', 'typer') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = eval(result.stdout)
    assert "torch" not in loaded
    assert "stable_baselines3" not in loaded
    assert "casadi" not in loaded
    assert "typer" not in loaded
