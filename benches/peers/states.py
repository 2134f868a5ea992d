#!/usr/bin/env python3
"""The states of spheres that the grain peers and the solver start from (P-7, P-10, P-13).

  states.py unpack NAME FILE.csv      x, y, z, r in m, in the order in which they were made
  states.py sample NAME FILE.csv      the same as a sample of the solver: x, y, z, radius, material `soil`
  states.py pack FILE.csv[.gz] NAME   the way back

  box_packed      100,000 spheres of 2 mm at rest in a box of 0.2 m, periodic in x and y, on a floor
  fissure_packed  47,702 spheres of 1 to 5 mm at rest in a V
  fissure_cloud   the same falling, without contacts

LAMMPS settled them. Kept in states/NAME.xz: one line of text (rows, quantum, lowest value of each column), then for each
column the four bytes of the multiples of the quantum, one byte of all rows after the other. The quantum, 4 nm, is a fiftieth
of the smallest overlaps.
"""
import gzip
import lzma
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
QUANTUM = 4e-9


def path_of(name):
    return f"{HERE}/states/{name}.xz"


def load(name):
    """Rows of x, y, z, r."""
    with lzma.open(path_of(name)) as f:
        head = f.readline().split()
        body = f.read()
    rows, quantum, lowest = int(head[0]), float(head[1]), [float(word) for word in head[2:]]
    columns = []
    for k, low in enumerate(lowest):
        planes = [body[(4 * k + byte) * rows:(4 * k + byte + 1) * rows] for byte in range(4)]
        columns.append([low + quantum * (a | b << 8 | c << 16 | d << 24) for a, b, c, d in zip(*planes)])
    return list(zip(*columns))


def pack(source, name):
    with (gzip.open if source.endswith(".gz") else open)(source, "rt") as f:
        f.readline()
        columns = list(zip(*[[float(word) for word in line.split(",")[:4]] for line in f]))
    head = [str(len(columns[0])), repr(QUANTUM)]
    body = b""
    for column in columns:
        low = min(column)
        head.append(repr(low))
        words = b"".join(round((x - low) / QUANTUM).to_bytes(4, "little") for x in column)
        body += b"".join(words[byte::4] for byte in range(4))
    with open(path_of(name), "wb") as f:
        f.write(lzma.compress((" ".join(head) + "\n").encode() + body, preset=9))


def main():
    if len(sys.argv) != 4 or sys.argv[1] not in ("unpack", "sample", "pack"):
        sys.exit(__doc__)
    command, first, second = sys.argv[1:]
    if command == "pack":
        pack(first, second)
        return
    end = ",soil\n" if command == "sample" else "\n"
    with open(second + ".part", "w") as f:
        f.write("x,y,z,radius,material\n" if command == "sample" else "x,y,z,r\n")
        for row in load(first):
            f.write(",".join(f"{x:.9g}" for x in row) + end)
    os.replace(second + ".part", second)


if __name__ == "__main__":
    main()
