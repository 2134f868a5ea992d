"""Backward erosion piping of discs below a cover of 240 diameters, up to the passage of the front."""

from piping_grains import tables


def main():
    tables({240: 1}, "piping_grains_240")


if __name__ == "__main__":
    main()
