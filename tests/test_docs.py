"""Every block of the pages in docs runs, from outside the package, and does what the page says."""

import ast
import re
import subprocess
import sys
from pathlib import Path

from shared_control_env.cli import app

ROOT = Path(__file__).parent.parent
EXTENDING = ROOT / "docs/extending.md"

# What must be true after the blocks under a heading have run.
CHECKS = {
    "A kind of degradation": """
        for made in (env, gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, config={"faults": [fault]})):
            made.reset(seed=0)
            lost = [made.step(np.zeros(made.action_space.shape))[4] for _ in range(30)][-1]
            assert np.all(np.ravel(lost["fault_active"])) and np.all(np.ravel(np.atleast_2d(lost["u_a_f"])[:, 1]) == 0.0)
        drawn.reset(seed=0)
        assert drawn.unwrapped.episode.faults[0].kind == "dead_band"
        assert "sticky_wheel" not in gym.make("SharedControl/Bend-v1").unwrapped.config["degradations"]
        refused(lambda: add_kind(Kind("dead_band", SHARE, act=dead_band)), "is there already")
        refused(lambda: add_kind(Kind("odd", "metres", act=dead_band)), "unit")
        refused(lambda: gym.make("SharedControl/TwoLane-v1", config={"faults": [{**fault, "kind": "dead_bend"}]}), "dead_band")
        refused(lambda: gym.make("SharedControl/TwoLane-v1", config={"faults": [{**fault, "size": 1.5}]}), "[0, 1]")
    """,
    "A tyre": """
        dry = gym.make("SharedControl/Curve-v1")
        speeds = []
        for made in (dry, wet, light):
            made.reset(seed=0)
            speeds.append([made.step(np.array([0.0, 0.6]))[4]["state"][4] for _ in range(12)][-1])
        assert len(set(speeds)) == 3
        slide = gym.make_vec("SharedControl/Curve-v1", num_envs=2, config={"vehicle": {"tyre": "saturating", "mu": 0.4}})
        slide.reset(seed=0)
        assert [slide.step(np.full((2, 2), [0.0, 0.6]))[4]["state"][0, 4] for _ in range(12)][-1] == speeds[1]
        import copy, pickle
        again = pickle.loads(pickle.dumps(wet.unwrapped))
        action = {"driver": np.zeros(2), "authority": np.ones(1)}
        np.testing.assert_array_equal(again.step(action)[0], copy.deepcopy(wet.unwrapped).step(action)[0])
    """,
    "An observation": """
        assert wheel.observation_space.shape == (3,)
        first = wheel.reset(seed=0)[0]
        assert first.shape == (3,) and first in wheel.observation_space
        assert gym.make("SharedControl/TwoLane-v1").observation_space.shape == (25,)
        refused(lambda: gym.make("SharedControl/TwoLane-v1", config={"observation": {"type": "wheel"}}), "wheel-v0")
        refused(lambda: wheel.reset(options={"config": {"observation": {"type": "driver-v0"}}}), "make a new one")
    """,
    "A term of the reward": """
        calm.reset(seed=0)
        for _ in range(15):
            _, reward, _, _, info = calm.step(np.array([0.0, 0.5]))
        assert info["rewards"]["smooth"] == -min(1.0, calm.unwrapped.scene["z"][4] ** 2) < 0.0
        plain = gym.make("SharedControl/TwoLane-v1")
        plain.reset(seed=0)
        for _ in range(15):
            _, other, _, _, bare = plain.step(np.array([0.0, 0.5]))
        assert "smooth" not in bare["rewards"] and abs(reward - other - 0.2 * info["rewards"]["smooth"]) < 1e-12
        many_calm = gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, config={"reward_terms": [{"term": "smooth", "weight": 0.2}]})
        many_calm.reset(seed=0)
        for _ in range(15):
            _, rewards, _, _, infos = many_calm.step(np.full((2, 2), [0.0, 0.5]))
        assert rewards[0] == reward and infos["rewards"]["smooth"][0] == info["rewards"]["smooth"]
    """,
    "An allocator": """
        observations = [made.reset(seed=0)[0] for made in (careful, fuzzy)]
        many.reset(seed=0)
        for _ in range(20):
            one, all_of_them = careful.step(np.zeros(2))[4], many.step(np.zeros((8, 2)))[4]
            assert one["alpha_a"] == all_of_them["alpha_a"][0]
        assert one["alpha_a"] == 0.5 * (1.0 - one["r_y"])
        refused(lambda: gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, limiter=FixedAuthority()), "compiled")
        assert set(evaluate("scripted", {"careful": Careful}, "paper")["authority"]) == {"careful"}
    """,
    "An automation": """
        cruising.reset(seed=0)
        info = cruising.step(np.zeros(2))[4]
        np.testing.assert_allclose(info["u_a_des"], Cruise().act(cruising.unwrapped.scene).command, atol=0.1)
        assert len(table) == 2 and set(table["authority"]) == {"proportional"}
        other = evaluate("scripted", "proportional", "paper")
        assert not np.allclose(table["lateral_rms"], other["lateral_rms"])
        refused(lambda: gym.make_vec("SharedControl/TwoLane-v1", num_envs=2, automation=Cruise()), "automation")
    """,
    "A driver": """
        gentle.reset(seed=0)
        assert np.isfinite(gentle.step(0)[1])
        assert set(mine["driver"]) == {"gentle"}
    """,
    "A scenario": """
        on_the_ramp.reset(seed=1)
        assert 10.0 <= on_the_ramp.unwrapped.episode.ego.speed <= 12.0
        ramps.reset(seed=0)
        assert set(ranked["scenario"]) == {"ramp"} and len(ranked) == 8
        refused(lambda: add_scenario("ramp", ramp), "is there already")
        refused(lambda: evaluate("scripted", "paper", Suite("s", ("rampe",), (None,))), "ramp")
    """,
    "A metric": """
        assert measured["lateral_speed_max"].max() > 0.0
        refused(lambda: metric("m", "smaller"), "lower")
        refused(lambda: metric("m", "lower")(lateral_speed_max), "is there already")
    """,
}
PRELUDE = """
import numpy as np
from shared_control_env.controllers.allocators import FixedAuthority
from shared_control_env.evaluation import evaluate


def refused(act, words):
    try:
        act()
    except ValueError as error:
        assert words in str(error), str(error)
        return
    raise AssertionError(f"not refused: {words}")
"""


def sections():
    """Heading and blocks of every section with code."""
    for part in EXTENDING.read_text().split("\n## ")[1:]:
        heading, _, text = part.partition("\n")
        yield heading.strip(), re.findall(r"```python\n(.*?)```", text, re.S)


def test_every_recipe_has_a_check():
    assert [heading for heading, _ in sections()] == list(CHECKS)


def test_the_recipes_run_from_outside_the_package(tmp_path):
    """All of them one after the other, in a file of another folder."""
    code = [PRELUDE]
    for heading, blocks in sections():
        check = "\n".join(line[8:] for line in CHECKS[heading].strip("\n").split("\n"))
        code += [*blocks, f"# {heading}", check]
    path = tmp_path / "recipes.py"
    path.write_text("\n\n".join(code))
    result = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr


def test_the_worked_example_runs(tmp_path):
    """The block of the page on controllability: six curves, and the limiter that is best in it takes the larger fault."""
    text = (ROOT / "docs/controllability.md").read_text()
    (block,) = re.findall(r"```python\n(.*?)```", text, re.S)
    check = "of = table.set_index(['over', 'authority'])['s_90']\nassert of['size', 'barrier'] > of['size', 'none']\n"
    (tmp_path / "example.py").write_text(block + check + "assert len(table) == 6\n")
    result = subprocess.run([sys.executable, "example.py"], capture_output=True, text=True, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "curve_at_25/report.html").is_file()
    assert "```text" in text  # the output that the page shows


def test_the_page_on_people_at_the_wheel(tmp_path):
    """Its Python runs; its plan is one; its study and identification run with simulated people."""
    from shared_control_env.drive.study.plan import read_plan

    text = "\n".join((ROOT / f"docs/{name}.md").read_text() for name in ("at_the_wheel", "study", "identification"))
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True).returncode == 0
    (plan,) = re.findall(r"```toml\n(.*?)```", text, re.S)
    (tmp_path / "plan.toml").write_text(plan)
    assert read_plan(tmp_path / "plan.toml").repetitions == 4
    command = [sys.executable, "-m", "shared_control_env.cli"]
    for arguments in (
        "study plan.toml --simulate population --people 2 --remnant 0.005",
        "identify results/study/plan --condition unlimited",
    ):
        result = subprocess.run([*command, *arguments.split()], cwd=tmp_path, capture_output=True, text=True)
        assert result.returncode == 0, result.stdout + result.stderr
    assert (tmp_path / "results/identification/report.html").is_file()
    for command_line in re.findall(r"^    shared-control (.*)$", text, re.M):
        name = command_line.split()[0]
        assert subprocess.run([*command, name, "--help"], capture_output=True).returncode == 0


def test_the_table_of_equations_is_that_of_the_sources():
    """Each function is there, names its equation, and is tested in the file that the table names."""
    rows = re.findall(
        r"^\| (\d+) \| .* \| `(.+)`: `(\w+)` \| `(.+)` \|$", (ROOT / "docs/equations.md").read_text(), re.M
    )
    assert len(rows) >= 13
    for number, file, name, test in rows:
        source = (ROOT / "shared_control_env/core" / file).read_text()
        (found,) = [node for node in ast.walk(ast.parse(source)) if getattr(node, "name", None) == name]
        told = (ast.get_docstring(found) or "") + (ast.get_docstring(ast.parse(source)) or "")
        assert re.search(rf"Eq\. (\d+(, |-))*{number}\b", told), (number, file, name)
        module = file.removesuffix(".py").replace("/", ".")
        assert module.split(".")[-1] in (ROOT / test).read_text() or name in (ROOT / test).read_text(), test


def test_links_between_pages_lead_somewhere():
    for page in (ROOT / "docs").glob("*.md"):
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text()):
            assert (page.parent / target).is_file(), f"{page.name}: {target}"


def test_commands_on_the_pages_exist():
    """Modules that are run, targets of make, and commands of shared-control."""
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.M))
    commands = {command.name or command.callback.__name__ for command in app.registered_commands}
    commands |= {group.name for group in app.registered_groups}
    for page in (ROOT / "docs").glob("*.md"):
        text = page.read_text()
        assert set(re.findall(r"`make ([a-z]+)`", text)) <= targets, page.name
        assert set(re.findall(r"^    shared-control ([a-z]+)", text, re.M)) <= commands, page.name
        for module in re.findall(r"^    (?:\S*bin/)?python -m ((?:agents|experiments|benchmarks)\.\w+)", text, re.M):
            assert (ROOT / module.replace(".", "/")).with_suffix(".py").is_file(), (page.name, module)
