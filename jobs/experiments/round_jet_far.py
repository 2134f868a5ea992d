"""The round jet at the larger distance."""

from round_jet import study


def main():
    study("far", "round_jet_far")


if __name__ == "__main__":
    main()
