"""The benchmark on a Ray cluster: on this machine, or on one that runs already (extra ray; address=auto)."""

import sys

from shared_control_env.evaluation import Suite, evaluate, summarise

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 20

if __name__ == "__main__":
    suite = Suite("curves", ("bend", "s_curve"), ("none", "step_bias", "delay"))
    table = evaluate(
        ["mpc", "internal_model"],
        ["proportional", "none"],
        suite,
        seeds=range(SEEDS),
        engine="ray",
        jobs=2,
        progress=lambda done, total: print(f"\r{done} of {total} episodes", end="", flush=True),
    )
    print()
    means = summarise(table)
    print(means[means["metric"].isin(["lateral_rms", "terminated"])].to_string(index=False, max_rows=20))
