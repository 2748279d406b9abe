"""``python -m tests.golden`` compares the commands' output with the kept documents, to 1e-9.

With the argument ``keep`` it replaces the kept documents. The test allows 1 %, because another
processor rounds differently, and a limit cycle on one encoder count amplifies that. Before and
after a change on the same machine, nothing may differ.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from tests.golden.commands import COMMANDS, KEPT, differences, documents

SHARE = 1e-9


def main() -> int:
    keep = sys.argv[1:] == ["keep"]
    KEPT.mkdir(exist_ok=True)
    found = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, now in documents(COMMANDS, Path(folder)):
            path = KEPT / name
            if keep:
                path.write_text(json.dumps(now, indent=1, ensure_ascii=False) + "\n")
                continue
            for line in differences(json.loads(path.read_text()), now, SHARE):
                print(f"{name}: {line}")
                found += 1
    print(f"{found} differences" if not keep else f"kept in {KEPT.name}")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
