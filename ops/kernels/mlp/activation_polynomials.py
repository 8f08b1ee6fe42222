"""The coefficients of activation.hpp:
    python3 ops/kernels/mlp/activation_polynomials.py
prints those of least largest error, in the order of the header, and that error;
    python3 ops/kernels/mlp/activation_polynomials.py --check ops/kernels/mlp/activation.hpp
fails where the header's have an error more than 1 % above the least. (They came from a fit on a
grid in double precision and differ from the sixth digit on; the error of floats is larger.) Needs
mpmath (Debian: python3-mpmath); the build does not need it, nor this file.

The coefficients are found by Remez' exchange in 60 digits (E. Ya. Remez, 1934; of quotients:
A. Ralston, Numer. Math. 7, 1965): the error takes its largest size, with alternating signs, at one
point more than there are coefficients; points and coefficients are improved in turn until it does.
"""

import argparse
import re
import sys

try:
    import mpmath
except ImportError as error:
    print("skipped:", error)
    sys.exit(77)
from mpmath import mpf

mpmath.mp.dps = 60
GRID = 1500  # points of the search for the extrema, before they are refined


def polynomial(coefficients, x):
    return mpmath.polyval(list(reversed(coefficients)), x)


def extrema(error, points, least, largest):
    """The extrema of an error curve, one between each two of its changes of sign, refined."""
    grid = [least + (largest - least) * (1 - mpmath.cos(mpmath.pi * k / GRID)) / 2
            for k in range(GRID + 1)]
    values = [error(x) for x in grid]
    found = []
    for k, value in enumerate(values):
        if value == 0:
            continue
        if found and values[found[-1]] * value > 0:
            if abs(value) > abs(values[found[-1]]):
                found[-1] = k
        else:
            found.append(k)
    if len(found) < points:
        raise ArithmeticError("{} extrema of {}".format(len(found), points))
    while len(found) > points:  # the smaller of the two at the ends is no alternation
        found.pop(0 if abs(values[found[0]]) < abs(values[found[-1]]) else -1)
    refined = []
    for k in found:
        if k == 0 or k == GRID:
            refined.append(grid[k])
            continue
        low, high = grid[k - 1], grid[k + 1]
        for _ in range(60):  # thirds: to 1e-10 of the interval; the error is flat there
            a, b = low + (high - low) / 3, high - (high - low) / 3
            if abs(error(a)) < abs(error(b)):
                low = a
            else:
                high = b
        refined.append((low + high) / 2)
    return refined


def remez(solve, points, least, largest):
    """solve(points) → (coefficients, error curve); returns both when the error is level."""
    at = [least + (largest - least) * (1 - mpmath.cos(mpmath.pi * (k + mpf(1) / 2) / points)) / 2
          for k in range(points)]
    for _ in range(40):
        coefficients, error = solve(at)
        at = extrema(error, points, least, largest)
        sizes = [abs(error(x)) for x in at]
        if max(sizes) - min(sizes) < mpf(10) ** -16 * max(sizes):
            return coefficients, max(sizes)
    raise ArithmeticError("the exchange does not settle")


def power_error(coefficients):
    """Turned over at 0, where it has a zero without alternation."""
    return lambda r: (polynomial(coefficients, r) / mpf(2) ** r - 1) * mpmath.sign(r)


def power_of_two(degree):
    """p(r) = 1 + c_1 r + ... of least largest |p(r)/2^r - 1| on [-1/2, 1/2]."""

    def solve(at):
        # r q(r) - (2^r - 1) = ±E 2^r sign(r): q approximates (2^r - 1)/r with a weight of |r|.
        rows, right = mpmath.matrix(degree + 1), mpmath.matrix(degree + 1, 1)
        for k, r in enumerate(at):
            for n in range(degree):
                rows[k, n] = r ** (n + 1)
            rows[k, degree] = (-1) ** k * mpf(2) ** r * mpmath.sign(r)
            right[k] = mpf(2) ** r - 1
        coefficients = [mpf(1)] + list(mpmath.lu_solve(rows, right))[:degree]
        return coefficients, power_error(coefficients)

    return remez(solve, degree + 1, mpf(-1) / 2, mpf(1) / 2)


def target(x):
    return mpmath.erf(x / mpmath.sqrt(2)) / 2


def quotient_error(P, Q):
    return lambda x: x * polynomial(P, x * x) / polynomial(Q, x * x) - target(x)


def normal_integral(degree):
    """P, Q of x P(x^2)/Q(x^2), Q(0) = 1, of least largest distance from erf(x/sqrt 2)/2 on [0, 6]
    (odd: on [-6, 6])."""

    def solve(at):
        # x P = (f + E_k) Q: without P, by what is normal to its columns, the E are the eigenvalues
        # of a pencil in Q; the one whose Q does not change its sign is it.
        size, half = 2 * degree + 2, degree + 1
        odd, even = mpmath.matrix(size, half), mpmath.matrix(size, half)
        for k, x in enumerate(at):
            for n in range(half):
                odd[k, n], even[k, n] = x ** (2 * n + 1), x ** (2 * n)
        normal = mpmath.qr(odd)[0][:, half:].T
        signed = mpmath.diag([(-1) ** k for k in range(size)]) * even
        valued = mpmath.diag([target(x) for x in at]) * even
        levels, vectors = mpmath.eig(mpmath.inverse(normal * signed) * (-normal * valued))
        candidates = []
        for k, level in enumerate(levels):
            Q = [vectors[n, k] / vectors[0, k] for n in range(half)]
            real = all(abs(mpmath.im(q)) < mpf(10) ** -20 * abs(q) for q in Q)
            Q = [mpmath.re(q) for q in Q]
            if real and all(polynomial(Q, mpf(36) * n / 200) > 0 for n in range(201)):
                candidates.append((abs(level), mpmath.re(level), Q))
        if not candidates:
            raise ArithmeticError("no quotient without a pole")
        _, level, Q = min(candidates, key=lambda c: c[0])
        right = mpmath.matrix([(target(x) + (-1) ** k * level) * polynomial(Q, x * x)
                               for k, x in enumerate(at[:half])])
        P = list(mpmath.lu_solve(odd[:half, :], right))
        return (P, Q), quotient_error(P, Q)

    return remez(solve, 2 * degree + 2, mpf(0), mpf(6))


def largest(error, points, least, most):
    return max(abs(error(x)) for x in extrema(error, points, least, most))


def header_coefficients(name):
    """Those of 2^r (r^5 first, the 1 left off), P and Q, highest power first."""
    with open(name) as file:
        text = file.read()
    number = r"([0-9.]+(?:e-?[0-9]+)?)F\)"
    power = text[text.index("V bounded_power"):text.index("V bounded_exp")]
    gelu = text[text.index("V gelu_lanes"):text.index("if (slope)")]
    found = [re.findall(r"V p\(" + number + "|p, r, V\\(" + number, power)]
    for name in "pq":
        found.append(re.findall(r"\b{0}\({1}|{0}, square, V\({1}".format(name, number), gelu))
    power, P, Q = [[mpf(a or b) for a, b in matches] for matches in found]
    assert (len(power), len(P), len(Q)) == (6, 6, 6) and power[-1] == 1 and Q[-1] == 1, found
    return power[::-1], (P[::-1], Q[::-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", metavar="HEADER", help="hold its errors against the least")
    header = parser.parse_args().check
    power, least_power = power_of_two(5)
    quotient, least_quotient = normal_integral(5)
    if header is None:
        for name, coefficients, error in (("2^r", power, least_power),
                                          ("P", quotient[0], least_quotient),
                                          ("Q", quotient[1], least_quotient)):
            print("{}, highest power first; largest error {}".format(name, mpmath.nstr(error, 3)))
            for c in reversed(coefficients):
                print("  " + mpmath.nstr(c, 12))
        return 0
    status = 0
    found_power, found_quotient = header_coefficients(header)
    for name, error, least in (
            ("2^r", largest(power_error(found_power), 6, mpf(-1) / 2, mpf(1) / 2), least_power),
            ("P/Q", largest(quotient_error(*found_quotient), 12, mpf(0), mpf(6)), least_quotient)):
        ratio = error / least
        print("{}: largest error {}, {} of the least".format(
            name, mpmath.nstr(error, 4), mpmath.nstr(ratio, 5)))
        if not ratio <= mpf("1.01"):
            status = 1
    return status


sys.exit(main())
