#!/usr/bin/env python3
"""Prints the decay of a half-immersed cylinder that is let go above its place of rest, in linear theory. Needs numpy and mpmath.

The water is unbounded and deep. Its potential is a source and multipoles at the axis (F. Ursell, Q. J. Mech. Appl. Math. 2
(1949) 218), fitted to the motion of the wet half. The layer of Stokes on it acts with the velocity s of the water along the
wall relative to the wall: the added mass grows by (nu/w)^0.5 exp(i pi/4) times the integral of s^2 over the wet half, by
reciprocity. Times go as exp(-i w t), lengths are in radii R, times in (R/g)^0.5, the density of water is 1.
"""

import numpy as np
from mpmath import e1, mpc

CELL = 1e-4
POINTS = 60
POLES = 10


def source(x, y, k0):
    """Returns PV int exp(-k y) cos(k x) / (k - k0) dk + i pi exp(-k0 y) cos(k0 x), y downwards."""
    found = np.zeros(len(x), complex)
    for n, (a, b) in enumerate(zip(x, y)):
        z = complex(b, -a)
        side = np.sign(-k0 * z.imag)
        integral = np.exp(-k0 * z) * (complex(e1(mpc(-k0 * z))) + 1j * np.pi * side)
        found[n] = integral.real + 1j * np.pi * np.exp(-k0 * b) * np.cos(k0 * a)
    return found


def heave(k0):
    """Returns the added mass (complex: the imaginary part is the damping over w) and the integral of s^2, at unit velocity."""
    step = np.pi / 2 / POINTS
    angles = (np.arange(POINTS) + 0.5) * step

    def at(radius, turn=0.0):
        return source(radius * np.sin(angles + turn), radius * np.cos(angles + turn), k0)

    normal = [(at(1 + CELL) - at(1 - CELL)) / (2 * CELL)]
    along = [(at(1.0, CELL) - at(1.0, -CELL)) / (2 * CELL)]
    values = [at(1.0)]
    for m in range(1, POLES + 1):
        even, odd = 2 * m * angles, (2 * m - 1) * angles
        normal.append(-2 * m * np.cos(even) - k0 * np.cos(odd))
        along.append(-2 * m * np.sin(even) - k0 * np.sin(odd))
        values.append(np.cos(even) + k0 / (2 * m - 1) * np.cos(odd))
    strengths = np.linalg.lstsq(np.array(normal).T, np.cos(angles).astype(complex), rcond=None)[0]
    potential = np.array(values).T @ strengths
    slip = np.array(along).T @ strengths + np.sin(angles)
    return -2 * step * np.sum(potential * np.cos(angles)), 2 * step * np.sum(slip**2)


def decay(viscosity, table):
    """Returns the times and the heights over the initial one, for a viscosity over R (g R)^0.5."""
    coarse, masses, slips = table
    w = np.linspace(0.002, 6, 6000)

    def interpolate(values):
        return np.interp(w, coarse, values.real) + 1j * np.interp(w, coarse, values.imag)

    mass = np.pi / 2 + interpolate(masses) + np.sqrt(viscosity / w) * np.exp(0.25j * np.pi) * interpolate(slips)
    s = -1j * w
    transform = s * mass / (s * s * mass + 2.0)
    times = np.linspace(0, 14, 2801)
    return times, np.array([2 / np.pi * np.trapezoid(transform.real * np.cos(w * t), w) for t in times])


frequencies = np.concatenate([np.linspace(0.05, 3, 60), np.linspace(3.1, 6, 20)])
found = [heave(w * w) for w in frequencies]
table = frequencies, np.array([mass for mass, _ in found]), np.array([slip for _, slip in found])
RADIUS, GRAVITY = 0.1, 9.81
for viscosity in (0, 1.7e-4, 1.7e-3):
    times, heights = decay(viscosity / (RADIUS * np.sqrt(GRAVITY * RADIUS)), table)
    turn = int(np.argmin(heights))
    crest = turn + int(np.argmax(heights[turn : turn + 900]))
    signs = np.nonzero(heights[1:] * heights[:-1] < 0)[0]
    passes = [times[i] + (times[i + 1] - times[i]) * heights[i] / (heights[i] - heights[i + 1]) for i in signs]
    passes = [float(t * np.sqrt(RADIUS / GRAVITY)) for t in passes[:3]]
    print(f"{viscosity} m2/s: passes", *(f"{t:.4f}" for t in passes), f"s, turn {-heights[turn]:.4f}, crest {heights[crest]:.4f}")
