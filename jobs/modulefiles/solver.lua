-- Environment module (Lmod) of the solver. Copy it to FOLDER/solver/0.1.0.lua and adapt the names of the modules and the prefix.
--
--   cargo install --locked --path . --root /opt/solver/0.1.0      in the root of the repository, with the same modules loaded
--   module use FOLDER
--   module load solver/0.1.0

local root = "/opt/solver/0.1.0"

help([[
Solver simulates how water erodes soil and rock: lattice Boltzmann or Darcy seepage with discrete elements, on MPI.
Run it with: mpirun -n N solver case.json, or: srun solver case.json. See solver --help.
]])

whatis("Name: solver")
whatis("Version: 0.1.0")
whatis("Description: water eroding grains and rock, lattice Boltzmann, discrete elements and Darcy seepage on MPI")

depends_on("openmpi", "hdf5")
prepend_path("PATH", pathJoin(root, "bin"))
prepend_path("MANPATH", pathJoin(root, "share", "man"))
