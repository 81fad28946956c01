# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as unevaluated sums of two floats, about twice as many digits (Dekker 1971; Hida, Li and Bailey 2001).

For sums that cancel. Works on arrays of float64 (32 digits) and of float32 (14 digits) alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@final
@dataclass(frozen=True)
class DoubleDouble:
    """high + low, arrays of one shape and dtype, with |low| at most half a unit in the last place of high."""

    high: Array
    low: Array

    def __add__(self, other: DoubleDouble) -> DoubleDouble:
        high, error = _two_sum(self.high, other.high)
        low, low_error = _two_sum(self.low, other.low)
        high, error = _fast_two_sum(high, error + low)
        return DoubleDouble(*_fast_two_sum(high, error + low_error))

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def __sub__(self, other: DoubleDouble) -> DoubleDouble:
        return self + -other

    def __mul__(self, other: DoubleDouble) -> DoubleDouble:
        high, error = _two_product(self.high, other.high)
        return DoubleDouble(*_fast_two_sum(high, error + (self.high * other.low + self.low * other.high)))

    def __getitem__(self, key: Any) -> DoubleDouble:
        return DoubleDouble(self.high[key], self.low[key])


def double_double(values: Array) -> DoubleDouble:
    """`values` without rounding."""
    return DoubleDouble(values, np.zeros_like(values))


def difference(a: Array, b: Array) -> DoubleDouble:
    """a - b without rounding."""
    return DoubleDouble(*_two_sum(a, -b))


def quotient(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """a / b; b must not be 0."""
    first = a.high / b.high
    rest = a - b * double_double(first)
    return DoubleDouble(*_fast_two_sum(first, rest.high / b.high))


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Rounded sum and what rounding lost (Knuth)."""
    total: Array = a + b
    b_part: Array = total - a
    return total, (a - (total - b_part)) + (b - b_part)


def _fast_two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """The same for |a| >= |b| (Dekker)."""
    total = a + b
    return total, b - (total - a)


def _two_product(a: Array, b: Array) -> tuple[Array, Array]:
    """Rounded product and what rounding lost (Dekker, with Veltkamp's splitting)."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _halves(a: Array) -> tuple[Array, Array]:
    """Leading and trailing digits, whose products are exact."""
    digits = np.finfo(a.dtype).nmant + 1
    shifted = a * a.dtype.type(2 ** ((digits + 1) // 2) + 1)
    high = shifted - (shifted - a)
    return high, a - high
