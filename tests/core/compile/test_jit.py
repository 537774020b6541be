import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]


def run(folder, code):
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(folder)
    command = [sys.executable, "-c", f"import types, sys; p = types.ModuleType('shared_control_env'); {code}"]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=folder)


@pytest.fixture
def copy(tmp_path):
    """The core alone, as a package of its own, without a cache."""
    target = tmp_path / "shared_control_env"
    shutil.copytree(ROOT / "shared_control_env/core", target / "core", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "shared_control_env/nearest.py", target)
    (target / "__init__.py").write_text("")
    return tmp_path


PROBE = "from shared_control_env.core.world.road import locate; import numpy as np; print(locate(np.array([[0., 0, 0, 0, 0, 9]]), 1.0, 2.0)[1])"


def test_a_cold_compile_says_so_once_and_a_warm_start_is_silent(copy):
    cold = run(copy, PROBE)
    assert cold.stderr.count("compiling the numerical core") == 1
    assert run(copy, PROBE).stderr == ""


def test_a_changed_source_is_not_served_from_the_cache(copy):
    assert run(copy, PROBE).stdout.strip() == "2.0"
    # _project is inlined into locate; numba's own check would look at locate's file alone, so change
    # a file that locate's does not hold.
    path = copy / "shared_control_env/core/faults/noise.py"
    path.write_text(path.read_text() + "\n# changed\n")
    again = run(copy, PROBE)
    assert again.stderr.count("compiling the numerical core") == 1
    assert again.stdout.strip() == "2.0"


def test_a_changed_equation_gives_the_new_number(copy):
    """Of a file deep in the rooms that no list names, inlined into a compiled function of another file."""
    probe = (
        "import numpy as np; from shared_control_env.core.entries import advance_arm; "
        "from shared_control_env.core.parameters import Parameters; from shared_control_env.core.records import pack; "
        "u = np.zeros(2); advance_arm(u, np.ones(2), np.zeros(2), pack(Parameters())); print(u[0])"
    )
    before = float(run(copy, probe).stdout)
    assert before == pytest.approx(1.0 - np.exp(-0.05 / 0.2))
    path = copy / "shared_control_env/core/control/driver_lag.py"
    path.write_text(path.read_text().replace("lag.K_h * (1.0 - phi)", "lag.K_h * (2.0 - phi)"))
    assert float(run(copy, probe).stdout) == pytest.approx(2.0 - np.exp(-0.05 / 0.2))
