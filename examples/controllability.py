"""The largest steering bias that persons control with and without a limit, as a table, a picture and a report."""

import sys
from pathlib import Path

from shared_control_env.evaluation import controllability

OUT = Path("results/examples/controllability")
BUDGET = int(sys.argv[1]) if len(sys.argv) > 1 else 2000

if __name__ == "__main__":  # with jobs=2, processes import this file
    authorities, scenarios = ["none", "proportional", "barrier"], ["lane_keeping", "bend"]
    margins = controllability("bias", authorities, "hands_on", scenarios=scenarios, budget=BUDGET, out=OUT)
    print(margins[["authority", "s_90", "s_90_low", "s_90_high", "unit"]].round(3).to_string(index=False))
    print(f"The report is {OUT / 'report.html'}. An interrupted run goes on from there.")
