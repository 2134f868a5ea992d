"""Exact solutions of seepage for the random scenes of soil water: standard library only."""

import cmath
import math


def gauss(count):
    """Nodes and weights of Gauss and Legendre on 0 to 1."""
    nodes = []
    for n in range(count):
        x = math.cos(math.pi * (n + 0.75) / (count + 0.5))
        for _ in range(100):
            p0, p1 = 1.0, x
            for k in range(2, count + 1):
                p0, p1 = p1, ((2 * k - 1) * x * p1 - (k - 1) * p0) / k
            slope = count * (x * p1 - p0) / (x * x - 1)
            step = p1 / slope
            x -= step
            if abs(step) < 1e-15:
                break
        nodes.append((0.5 * (1 - x), 1 / ((1 - x * x) * slope * slope)))
    return nodes


NODES = gauss(96)


def integral(function, low, high):
    """Integral whose integrand may have weak singularities at both ends: the nodes are dense there."""
    total = 0.0
    for t, weight in NODES:
        place, stretch = t * t * t * (10 - 15 * t + 6 * t * t), 30 * t * t * (1 - t) ** 2
        total += weight * stretch * function(low + (high - low) * place)
    return total * (high - low)


def elliptic(complement):
    """Complete elliptic integral K of the parameter 1 - complement, by the arithmetic-geometric mean."""
    a, b = 1.0, math.sqrt(complement)
    while abs(a - b) > 1e-15 * a:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return math.pi / (a + b)


class Strip:
    """Confined flow under a flat base from -left to right with a cut-off of depth s at 0, in a stratum of depth T on an
    impervious base (M. E. Harr, Groundwater and Seepage, 1962): the strip is mapped by u = sqrt(tanh^2(pi z/(2 T)) + tan^2(pi s/(2 T)))
    to a half-plane, in which both equipotentials and both impervious boundaries are intervals of the real axis. k_h = ratio k_v is the
    isotropic strip with lengths along x divided by sqrt(ratio) and the permeability sqrt(k_h k_v)."""

    def __init__(self, depth, left, right, cut, drop, horizontal, ratio=1.0):
        self.depth, self.cut, self.drop = depth, cut, drop
        self.stretch = math.sqrt(ratio)
        self.k = horizontal / self.stretch
        self.t = math.tan(0.5 * math.pi * cut / depth)
        end = math.sqrt(1 + self.t**2)
        base = [math.hypot(math.tanh(0.5 * math.pi * b / self.stretch / depth), self.t) for b in (left, right)]
        self.points = (-end, -base[0], base[1], end)
        self.left, self.right = left, right
        self.across = self.between(1, 2)

    def between(self, low, high):
        """Integral of 1/sqrt|(u - a)(u - b)(u - c)(u - d)| between two neighbours of the four points."""
        lower, upper = self.points[low], self.points[high]
        others = [p for n, p in enumerate(self.points) if n not in (low, high)]
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        count = 4000
        total = 0.0
        for n in range(count):
            u = middle + half * math.cos(math.pi * (n + 0.5) / count)
            total += 1 / math.sqrt(abs((u - others[0]) * (u - others[1])))
        return total * math.pi / count

    def discharge(self):
        return self.k * self.drop * self.between(2, 3) / self.across

    def share(self, x, down):
        """Head above that downstream, over the drop, at x and a depth below the surface."""
        a, b, c, d = self.points
        zeta = cmath.tanh(0.5 * math.pi * complex(x / self.stretch, down) / self.depth)
        u = cmath.sqrt(zeta * zeta + self.t**2)
        if u.imag < 0 or (u.imag == 0 and (u.real < 0) != (x < 0)):
            u = -u
        total = 0.0
        # u = c + (end - c) t^2 removes the root at c.
        for t, weight in NODES:
            point = c + (u - c) * t * t
            product = cmath.sqrt(point - a) * cmath.sqrt(point - b) * cmath.sqrt(point - d)
            # sqrt(point - c) = sqrt(u - c) t
            total += weight * 2 * cmath.sqrt(u - c) / product
        return abs(total.real) / self.across

    def base(self):
        """Integrals over the base of the head above that downstream, over the drop, and of its product with the distance from the heel."""
        a, b, c, d = self.points
        count = 4000
        angles = [math.pi * (n + 0.5) / count for n in range(count)]
        middle, half = 0.5 * (b + c), 0.5 * (c - b)
        lengths, shares, done = [], [], 0.0
        for angle in angles:
            u = middle + half * math.cos(angle)
            term = math.pi / count / math.sqrt((u - a) * (d - u))
            shares.append((done + 0.5 * term) / self.across)
            done += term
            inner = u * u - self.t**2
            zeta = math.sqrt(inner) if inner > 0 else 0.0
            lengths.append(math.copysign(2 * self.depth / math.pi * math.atanh(min(zeta, 1 - 1e-16)) * self.stretch, u))
        # From the toe to the heel: the share grows from 0 to 1 while x falls.
        force = moment = 0.0
        ends = [(self.right, 0.0)] + list(zip(lengths, shares)) + [(-self.left, 1.0)]
        for (x1, s1), (x2, s2) in zip(ends, ends[1:]):
            p1, p2 = x1 + self.left, x2 + self.left
            force += 0.5 * (s1 + s2) * (x1 - x2)
            moment += (x1 - x2) * (p1 * (2 * s1 + s2) + p2 * (s1 + 2 * s2)) / 6
        return force, moment

    def exit_gradient(self):
        """Largest exit gradient beside a cut-off at the end of the base, where right = 0."""
        a, b, c, d = self.points
        slope = math.sqrt(2 * self.t) / (self.t * math.sqrt((c - a) * (c - b) * (d - c)))
        return self.drop / self.across * slope * 0.5 * math.pi / self.depth


class Slit:
    """A slit of depth s from the top of a confined strip of thickness T that holds the head at x = 0, and heads at -length and length. The
    symmetric part is mapped by cosh(pi z/T), the antisymmetric part is linear. Exact up to exp(-pi length/T)."""

    def __init__(self, depth, cut, length, heads, held, k):
        self.depth, self.length, self.heads, self.held, self.k = depth, length, heads, held, k
        self.edge = math.cos(math.pi * cut / depth)
        mean = 0.5 * (heads[0] + heads[1]) - held
        self.half = k * mean / (length / depth + 2 / math.pi * math.log(1 / math.sin(0.5 * math.pi * cut / depth)))

    def discharge(self):
        """Water that leaves through the slit."""
        return 2 * self.half

    def head(self, x, down):
        zeta = cmath.cosh(math.pi * complex(abs(x), down) / self.depth)
        inner = (zeta - 0.5 * (1 + self.edge)) / (0.5 * (1 - self.edge))
        part = self.half / (math.pi * self.k) * abs(cmath.acosh(inner).real)
        return self.held + part + 0.5 * (self.heads[1] - self.heads[0]) * x / self.length


def dam_parts(alpha, beta):
    """Length, downstream level, seepage face and upstream level of a rectangular dam over a common factor (P. Ya. Polubarinova-Kochina)."""

    def over(function):
        return integral(function, 0.0, 0.5 * math.pi)

    def length(p):
        s, c = math.sin(p), math.cos(p)
        complement = (1 - alpha) * c * c + (1 - beta) * s * s
        return elliptic(complement) / math.sqrt(complement)

    def level(p):
        s2 = math.sin(p) ** 2
        return elliptic(1 - alpha * s2) * math.sin(p) / math.sqrt((1 - alpha * s2) * (beta - alpha * s2))

    def face(p):
        s, c = math.sin(p), math.cos(p)
        return elliptic(s * s) * s * c / math.sqrt((c * c + alpha * s * s) * (c * c + beta * s * s))

    def above(p):
        s, c = math.sin(p), math.cos(p)
        return elliptic(s * s) * s / math.sqrt((1 - alpha * s * s) * (1 - beta * s * s))

    lower = math.sqrt(alpha) * over(level) if alpha > 0 else 0.0
    seepage = over(face)
    return over(length), lower, seepage, lower + seepage + over(above)


def seepage_face(upper, lower, length):
    """Height of the seepage face of an isotropic rectangular dam between water levels."""

    def bisect(function, low, high):
        rising = function(high) > function(low)
        for _ in range(60):
            middle = 0.5 * (low + high)
            if (function(middle) > 0) == rising:
                high = middle
            else:
                low = middle
        return 0.5 * (low + high)

    def alpha(beta):
        if lower <= 0:
            return 0.0

        def excess(part):
            lengths = dam_parts(part * part * beta, beta)
            return lengths[1] / lengths[3] - lower / upper

        part = bisect(excess, 1e-6, 1 - 1e-6)
        return part * part * beta

    def excess(beta):
        parts = dam_parts(alpha(beta), beta)
        return parts[0] / parts[3] - length / upper

    beta = bisect(excess, 1e-6, 1 - 1e-6)
    parts = dam_parts(alpha(beta), beta)
    return parts[2] / parts[3] * upper


def dam_discharge(upper, lower, length, bands):
    """Discharge of a rectangular dam of horizontal bands (top, k_h) from below (I. A. Charny): the integral of k (h - y) over the height."""

    def charge(level):
        total, bottom = 0.0, 0.0
        for top, k in bands:
            high = min(top, level)
            if high > bottom:
                total += 0.5 * k * ((level - bottom) ** 2 - (level - high) ** 2)
            bottom = top
        return total

    return (charge(upper) - charge(lower)) / length


class LinearSoil:
    """Column of Gardner's soil above a water table, whose flux at the top jumps (R. Srivastava and T.-C. J. Yeh, Water Resour. Res. 27
    (1991) 753). Fluxes before and after over the conductivity at saturation; z from the water table, water that drains per volume."""

    def __init__(self, alpha, length, k, yielding, before, after):
        self.alpha, self.l, self.k, self.yielding = alpha, alpha * length, k, yielding
        self.length, self.before, self.after = length, before, after
        self.roots = []
        for n in range(400):
            low, high = ((n + 0.5) * math.pi + 1e-12) / self.l, ((n + 1) * math.pi - 1e-12) / self.l
            for _ in range(80):
                middle = 0.5 * (low + high)
                if math.tan(middle * self.l) + 2 * middle < 0:
                    low = middle
                else:
                    high = middle
            self.roots.append(0.5 * (low + high))

    def permeability(self, z, time):
        """Relative permeability."""
        y, t = self.alpha * z, self.alpha * self.k * time / self.yielding
        if time <= 0:
            return self.before - (self.before - 1) * math.exp(-y)
        total = 0.0
        for b in self.roots:
            decay = b * b * t
            if decay > 60:
                break
            total += math.sin(b * y) * math.sin(b * self.l) * math.exp(-decay) / (1 + 0.5 * self.l + 2 * b * b * self.l)
        series = 4 * (self.after - self.before) * math.exp(0.5 * (self.l - y) - 0.25 * t) * total
        return self.after - (self.after - 1) * math.exp(-y) - series

    def suction(self, z, time):
        """Pressure head, negative."""
        return math.log(self.permeability(z, time)) / self.alpha

    def water(self, time):
        """Water of the column above its residual content, per area."""
        return self.yielding * integral(lambda z: self.permeability(z, time), 0.0, self.length)


def theis(u):
    """Well function W(u)."""
    if u < 2:
        total, term = -0.57721566490153286 - math.log(u), 1.0
        for n in range(1, 60):
            term *= -u / n
            total -= term / n
        return total
    tail = 0.0
    for n in range(200, 0, -1):
        tail = n / (1 + n / (u + tail))
    return math.exp(-u) / (u + tail)


def consolidation(time_factor, share):
    """Excess head over its start at a depth (share of the drainage path), and the mean of it (K. Terzaghi)."""
    head = mean = 0.0
    for n in range(400):
        m = (n + 0.5) * math.pi
        decay = math.exp(-m * m * time_factor)
        if decay < 1e-18:
            break
        head += 2 / m * math.sin(m * share) * decay
        mean += 2 / (m * m) * decay
    return head, mean


def check():
    """Compares the solutions with published and closed values."""

    def near(found, wanted, within, what):
        assert abs(found - wanted) <= within * abs(wanted), f"{what}: {found}, not {wanted}"

    for upper, lower, length, face in [(1, 0, 1, 0.36824), (1, 0, 0.5, 0.63176), (1, 0.5, 1, 0.03624), (10, 2, 10, 1.93959), (3.22, 0.84, 1.62, 1.20385)]:
        near(seepage_face(upper, lower, length), face, 2e-4, f"seepage face {upper}, {lower}, {length}")
    for cut, ratio, wanted in [(0.5, 1, 0.5), (0.75, 1, 1.6335863074581471 / (2 * 2.400094459133703)), (0.5, 4, 0.5 * 0.5)]:
        near(Strip(1, 0, 0, cut, 1, 1, ratio).discharge(), wanted, 1e-6, f"pile {cut}")
    near(Strip(1, 0.5, 0.5, 0.5, 1, 1).discharge(), 1.7052004102572171 / (2 * 2.098138692130958), 1e-6, "cut-off below a base")
    near(Strip(1, 0.5, 0.5, 0.5, 1, 1).share(0.00625, 1e-12), 0.9786363564412358 / (2 * 2.098138692130958), 1e-6, "head below a base")
    near(Strip(1, 0, 0, 0.25, 1, 1).exit_gradient(), math.pi / (4 * 1.6335863074581471 * math.sin(math.pi / 8)), 1e-6, "exit gradient")
    deep = Strip(400, 1, 1, 0, 1, 1).base()
    near(deep[0], 1.0, 1e-3, "uplift on deep ground")
    near(deep[1], 0.75, 1e-3, "moment on deep ground")
    # A cut-off at the toe after Khosla: a = b/d = 5.
    toe = Strip(2000, 5, 0, 1, 1, 1)
    near(toe.share(-1e-6, 0), 0.38816, 2e-3, "Khosla, head at the toe")
    near(toe.exit_gradient(), 0.18228, 2e-3, "Khosla, exit gradient")
    near(dam_discharge(10, 2, 10, [(10, 1)]), 4.8, 1e-12, "discharge of a dam")
    soil = LinearSoil(10, 1, 1, 0.34, 0.1, 0.9)
    for z, time, head in [(0.2, 0.01, -0.150597), (0.6, 0.05, -0.19544), (0.8, 0.1, -0.049727), (1.0, 0.2, -0.012858)]:
        near(soil.suction(z, time), head, 1e-3, f"suction {z}, {time}")
    # The terms fall with the square of their number: 400 of them leave some 1e-5.
    near(soil.permeability(0.5, 1e-9), soil.permeability(0.5, 0), 1e-5, "start of the linear soil")
    for u, wanted in [(0.01, 4.03793), (0.5, 0.559774), (2, 0.0489005)]:
        near(theis(u), wanted, 1e-5, f"Theis {u}")
    near(consolidation(0.197, 1)[0], 0.777743, 1e-5, "consolidation")
    near(1 - consolidation(0.197, 1)[1], 0.500338, 1e-5, "degree of consolidation")
    slit = Slit(1, 1, 3, (1, 1), 0, 1)
    near(slit.discharge(), 2 / 3, 1e-9, "a slit through the strip")
    near(Slit(1, 0.5, 3, (1, 3), 0, 1).head(3 - 1e-9, 0.3), 3, 1e-3, "head at the end of a strip with a slit")
    near(Strip(1, 0, 0, 0.5, 1, 1).share(0.3, 0.4) + Strip(1, 0, 0, 0.5, 1, 1).share(-0.3, 0.4), 1, 1e-6, "symmetry")


if __name__ == "__main__":
    check()
    print("the exact solutions agree with the published values")
