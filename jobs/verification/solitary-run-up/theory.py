#!/usr/bin/env python3
"""Prints the run-up of a solitary wave on plane slopes by the linear theory of C. E. Synolakis (J. Fluid Mech. 185 (1987) 523).

The elevation at the shore is the integral over the spectrum of the wave,

    R(t)/h = int 2 Phi(k) exp(-i k t) / (J0(2 k X0) - i J1(2 k X0)) dk,   X0 = cot(slope),

and its formula 2.831 sqrt(cot b) (H/h)^(5/4) is the value of this integral for small slopes, cot b sqrt(H/h) >> 0.288. On a
wall the integral is 2 H. Lengths are in depths, times in sqrt(h/g); H/h is 0.1.
"""

import cmath
import math

HEIGHT = 0.1
STEP = 0.004


def bessel(order, x):
    """Returns J_order(x) by the integral of Bessel."""
    n = 400 if x < 50 else int(8 * x)
    angles = ((i + 0.5) * math.pi / n for i in range(n))
    return sum(math.cos(order * t - x * math.sin(t)) for t in angles) / n


def run_up(cot):
    """Returns the largest elevation at the shore over the depth."""
    rate = math.sqrt(0.75 * HEIGHT)
    numbers = [(i + 0.5) * STEP for i in range(int(12 * rate / STEP))]
    terms = []
    for k in numbers:
        amplitude = HEIGHT * k / (rate * rate * math.sinh(math.pi * k / (2 * rate)))
        terms.append((k, 2 * amplitude / (bessel(0, 2 * k * cot) - 1j * bessel(1, 2 * k * cot))))
    times = (0.01 * i * cot for i in range(-200, 1600))
    return max(sum((part * cmath.exp(-1j * k * t)).real for k, part in terms) * STEP for t in times)


for degrees in (90, 45, 30, 20, 15, 10):
    cot = 1 / math.tan(math.radians(degrees))
    found = run_up(max(cot, 1e-3))
    formula = 2.831 * math.sqrt(cot) * HEIGHT**1.25
    print(f"{degrees} degrees: R/h {found:.4f}, formula {formula:.4f}")
