"""Triaxial test of spheres, compared with LAMMPS."""

from laboratory import tables


def main():
    tables(("triaxial",), "triaxial")


if __name__ == "__main__":
    main()
