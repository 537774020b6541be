"""Learn from recordings: a dataset of the predictive driver, and its clone (extras train and minari)."""

import subprocess
import sys

EPISODES = sys.argv[1] if len(sys.argv) > 1 else "1000"
DATASET = f"shared-control/example-{EPISODES}-v0"

if __name__ == "__main__":
    import minari

    if DATASET not in minari.list_local_datasets():
        demonstrate = [sys.executable, "-m", "agents.demonstrate", "--episodes", EPISODES, "--dataset", DATASET]
        subprocess.run(demonstrate, check=True)
    out = f"results/examples/clone-{EPISODES}"
    clone = [sys.executable, "-m", "agents.clone", "--data", DATASET, "--episodes", "50", "--out", out]
    subprocess.run(clone, check=True)
