"""Runs the rows of the table in README.md again.

    python3 jobs/experiments/run.py NAME ...
"""

import importlib
import sys

ROWS = {name: name.replace("-", "_") for name in (
    "columns", "columns-reasons", "heap", "laboratory", "triaxial", "jet", "round-jet", "round-jet-far", "round-jet-crater", "chimney", "jet-erosion", "jet-erosion-stress", "backward-erosion",
    "piping-grains", "piping-grains-reasons", "piping-grains-240", "same-bits")}


def main():
    names = sys.argv[1:]
    help_text = f"{__doc__.strip()}\n\nrows: {', '.join(ROWS)}"
    if any(name in ("-h", "--help") for name in names):
        print(help_text)
        return
    unknown = [name for name in names if name not in ROWS]
    if unknown:
        sys.exit(f"no row is called {', '.join(unknown)}\n\n{help_text}")
    if not names:
        sys.exit(help_text)
    for name in names:
        importlib.import_module(ROWS[name]).main()


if __name__ == "__main__":
    main()
