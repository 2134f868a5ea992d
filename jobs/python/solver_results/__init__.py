"""Results of solver in Python: fields as numpy arrays, tables as pandas data frames, both with units.

>>> import solver_results
>>> with solver_results.open_run("results/flow") as run:       # doctest: +SKIP
...     print(run.summary["outcome"], run.fluid.times)
...     velocity = run.fluid[-1]["velocity"]                   # m/s, shape (nz, ny, nx, 3)
...     force = run.probes["force"]                            # a data frame
...     print(solver_results.units(force)["fluid_force_x"])    # N/m

All numbers are in SI units. Arrays of fields have the order (z, y, x), vectors have their components x, y, z last.
"""

from .errors import ReadError
from .outputs import Blocks, BlocksSeries, Contacts, ContactsSeries, Fields, FieldsSeries, Grains, GrainsSeries
from .run import Run, open_run
from .tables import read_table, units

__version__ = "0.1.0"

__all__ = [
    "Blocks",
    "BlocksSeries",
    "Contacts",
    "ContactsSeries",
    "Fields",
    "FieldsSeries",
    "Grains",
    "GrainsSeries",
    "ReadError",
    "Run",
    "open_run",
    "read_table",
    "units",
]
