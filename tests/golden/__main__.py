"""Make the golden rollouts anew, for a change that means to change them; say in the CHANGELOG which and why."""

import json

from tests.golden.rollouts import FILE, machine, rollouts

if __name__ == "__main__":
    before = json.loads(FILE.read_text())["rollouts"] if FILE.exists() else {}
    found = dict(rollouts())
    changed = [name for name, outcome in found.items() if before.get(name) != outcome]
    FILE.write_text(json.dumps({"machine": machine(), "rollouts": found}, indent=0) + "\n")
    print(f"{len(found)} rollouts, {len(changed)} of them new or changed: {', '.join(changed[:10])}")
