import pytest

from shared_control_env.nearest import hint, nearest

SETTINGS = ("duration", "automation", "lane_change", "law_tolerances", "scaling", "longitudinal_risk", "law", "mpc")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("duratoin", "duration"),
        ("Duration", "duration"),
        ("lane-change", "lane_change"),
        ("lanechange", "lane_change"),
        ("lwa", "law"),
        ("mcp", "mpc"),
        ("mpx", "mpc"),
        ("observation", None),
        ("action", None),
        ("lanes_count", None),
        ("show_trajectories", None),
        ("ego_spacing", None),
        ("x", None),
        ("", None),
        (3, None),
    ],
)
def test_only_what_is_near_is_suggested(name, meant):
    assert nearest(name, SETTINGS) == meant
    assert ("did you mean" in hint(name, SETTINGS)) == (meant is not None)
