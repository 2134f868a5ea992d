"""The round jet up to a crater, in one packing."""

from round_jet import study


def main():
    study("crater", "round_jet_crater")


if __name__ == "__main__":
    main()
