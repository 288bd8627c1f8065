"""Writes distributions.csv: quantiles and tails in 40-digit arithmetic, rounded to 20 digits.

    python tests/golden/distributions.py

Needs mpmath. Quantiles are roots of distribution functions that mpmath integrates or sums by itself,
so nothing is shared with the code under test.
"""

from __future__ import annotations

from pathlib import Path

from mpmath import mp, mpf

mp.dps = 40


def normal_cdf(x):
    return mp.erfc(-x / mp.sqrt(2)) / 2


def student_cdf(t, dof):
    tail = mp.betainc(mpf(dof) / 2, mpf(1) / 2, 0, dof / (dof + t * t), regularized=True) / 2
    return 1 - tail if t > 0 else tail


def chi_square_tail(x, dof):
    return mp.gammainc(mpf(dof) / 2, mpf(x) / 2, mp.inf, regularized=True)


def root(function, p):
    """The argument at which a growing function is p, by bisection to all digits."""
    low, high = mpf(-1), mpf(1)
    while function(low) > p:
        low *= 2
    while function(high) < p:
        high *= 2
    while high - low > mpf(10) ** -30 * max(abs(low), abs(high)):
        middle = (low + high) / 2
        if function(middle) < p:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def main() -> None:
    rows = ["# function,argument,dof,value; made by distributions.py"]

    def add(name, argument, dof, value):
        rows.append(f"{name},{argument},{dof},{mp.nstr(value, 20)}")

    # Arguments are decimal text; both sides take the double nearest to it.
    for p in ("1e-300", "1e-12", "0.001", "0.02425", "0.025", "0.3", "0.5", "0.8", "0.975", "0.9999"):
        add("normal_quantile", p, 0, root(normal_cdf, mpf(float(p))))
    for dof in ("0.5", "1", "2", "3", "5", "10", "29.5", "120", "1000", "100000"):
        for p in ("0.0005", "0.025", "0.4", "0.6", "0.9", "0.975", "0.99999"):
            add("student_quantile", p, dof, root(lambda t, d=mpf(dof): student_cdf(t, d), mpf(float(p))))
    for dof in ("0.5", "1", "2", "7", "14", "50", "400"):
        for share in ("0.01", "0.5", "1", "1.5", "4"):
            x = f"{float(share) * float(dof):.6g}"
            add("chi_square_tail", x, dof, chi_square_tail(mpf(float(x)), mpf(dof)))
    for x in ("100", "700", "1400"):
        add("chi_square_tail", x, "3", chi_square_tail(mpf(x), mpf(3)))
    Path(__file__).with_name("distributions.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
