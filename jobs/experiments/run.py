"""Runs the rows of the table in README.md again.

    python3 jobs/experiments/run.py NAME ...
                                      columns, jet, round-jet, chimney, heap, laboratory, triaxial, jet-erosion, backward-erosion, piping-grains
"""

import importlib
import sys

ROWS = {"columns": "columns", "heap": "heap", "laboratory": "laboratory", "triaxial": "triaxial", "jet": "jet", "round-jet": "round_jet", "chimney": "chimney",
        "jet-erosion": "jet_erosion", "backward-erosion": "backward_erosion", "piping-grains": "piping_grains"}


def main():
    names = sys.argv[1:]
    if not names or any(name not in ROWS for name in names):
        sys.exit(f"{__doc__.strip()}\n\nrows: {', '.join(ROWS)}")
    for name in names:
        importlib.import_module(ROWS[name]).main()


if __name__ == "__main__":
    main()
