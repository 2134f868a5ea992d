"""Spack package of the solver. In the root of this repository:

    spack repo add jobs/spack
    spack install solver

It builds the branch main of this repository; `spack dev-build solver@main` builds the working tree.
"""

import os

from spack.package import *

try:
    # Spack 1.0 and newer keep the build systems beside the packages.
    from spack_repo.builtin.build_systems.generic import Package
except ImportError:
    pass


class Solver(Package):
    """Water eroding grains and rock: lattice Boltzmann, discrete elements and Darcy seepage on MPI."""

    # The repository that holds this file.
    git = "file://" + os.path.abspath(os.path.join(os.path.dirname(__file__), *[os.pardir] * 4))

    license("MIT")

    version("main", branch="main")

    depends_on("c", type="build")
    depends_on("rust@1.89:", type="build")
    depends_on("pkgconfig", type="build")
    # libclang reads the headers of MPI when the bindings are made.
    depends_on("llvm+clang", type="build")
    depends_on("mpi@3:")
    depends_on("hdf5@1.10:1.14+mpi")

    def setup_build_environment(self, env):
        env.set("HDF5_DIR", self.spec["hdf5"].prefix)
        env.set("MPICC", self.spec["mpi"].mpicc)
        env.set("LIBCLANG_PATH", self.spec["llvm"].prefix.lib)
        # Neither library lies in a folder of the system.
        folders = [self.spec["hdf5"].prefix.lib, self.spec["mpi"].prefix.lib]
        env.set("RUSTFLAGS", " ".join(f"-C link-args=-Wl,-rpath,{folder}" for folder in folders))

    def install(self, spec, prefix):
        which("cargo")("install", "--locked", "--path", ".", "--root", prefix, "--no-track", "--jobs", str(make_jobs))
        # The manual page is printed by the program.
        mkdirp(prefix.share.man.man1)
        with open(join_path(prefix.share.man.man1, "solver.1"), "w", encoding="utf-8") as page:
            Executable(join_path(prefix.bin, "solver"))("man", output=page)

    def test_version(self):
        """the program starts and prints its versions"""
        Executable(join_path(self.prefix.bin, "solver"))("--version")
