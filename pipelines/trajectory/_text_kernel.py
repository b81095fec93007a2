"""Numbers as text, compiled: arrays in, bytes out. `solution_csv.write_plain` is their reference in tests."""

import math

import numpy as np
from numba import njit

_ZERO, _POINT, _MINUS, _COMMA, _END = 48, 46, 45, 44, 10


@njit(cache=True)
def _put_digits(text, at, value, least):  # type: ignore[no-untyped-def]
    """A whole number of at least that many digits; returns the place behind it."""
    count, rest = 1, value // 10
    while rest > 0:
        count, rest = count + 1, rest // 10
    count = max(count, least)
    for place in range(at + count - 1, at - 1, -1):
        text[place] = _ZERO + value % 10
        value //= 10
    return at + count


@njit(cache=True)
def _put_fixed(text, at, scaled, decimals):  # type: ignore[no-untyped-def]
    """scaled / 10^decimals with all its decimals."""
    if decimals == 0:
        return _put_digits(text, at, scaled, 1)
    power = 10**decimals
    at = _put_digits(text, at, scaled // power, 1)
    text[at] = _POINT
    return _put_digits(text, at + 1, scaled % power, decimals)


@njit(cache=True)
def _put_general(text, at, value, digits):  # type: ignore[no-untyped-def]
    """A value above zero to so many significant digits, without zeros behind them, as C's %g."""
    power = math.floor(math.log10(value))
    mantissa = round(_shift(value, digits - 1 - power))
    if mantissa < 10 ** (digits - 1):
        power -= 1
        mantissa = round(_shift(value, digits - 1 - power))
    if mantissa >= 10**digits:
        mantissa, power = mantissa // 10, power + 1
    plain = -4 <= power < digits
    decimals = digits - 1 - power if plain else digits - 1
    while decimals > 0 and mantissa % 10 == 0:
        mantissa, decimals = mantissa // 10, decimals - 1
    at = _put_fixed(text, at, mantissa, decimals)
    if plain:
        return at
    text[at], text[at + 1] = 101, _MINUS if power < 0 else 43
    return _put_digits(text, at + 2, abs(power), 2)


@njit(cache=True)
def _shift(value, power):  # type: ignore[no-untyped-def]
    """value 10^power; a division where that is the exact power of ten."""
    return value * 10.0**power if power >= 0 else value / 10.0**-power


@njit(cache=True)
def _put_utc(text, at, date, microsecond):  # type: ignore[no-untyped-def]
    """Of a date (10,) in ASCII and the time of that day: ISO 8601."""
    text[at : at + 10] = date
    text[at + 10] = 84
    second = microsecond // 1_000_000
    at = _put_digits(text, at + 11, second // 3600, 2)
    text[at] = 58
    at = _put_digits(text, at + 1, second // 60 % 60, 2)
    text[at] = 58
    at = _put_digits(text, at + 1, second % 60, 2)
    text[at] = _POINT
    at = _put_digits(text, at + 1, microsecond % 1_000_000, 6)
    text[at] = 90
    return at + 1


@njit(cache=True)
def put_rows(week, tow, days, dates, microseconds, numbers, decimals, status, names, text):  # type: ignore[no-untyped-def]
    """Fills text (bytes) with k lines and returns their length.

    week (k,), tow (k,) [ns of the week], days (k,) into dates (d, 10), microseconds (k,) of the day, numbers (k, c), decimals
    (c,) after the point or, negative, significant digits, status (k,) into names (s, w), filled up with zeros.
    """
    at = 0
    for row in range(len(week)):
        at = _put_digits(text, at, week[row], 1)
        text[at] = _COMMA
        at = _put_fixed(text, at + 1, tow[row], 9)
        text[at] = _COMMA
        at = _put_utc(text, at + 1, dates[days[row]], microseconds[row])
        for column in range(len(decimals)):
            text[at] = _COMMA
            at += 1
            value, digits = numbers[row, column], decimals[column]
            if math.copysign(1.0, value) < 0:
                text[at] = _MINUS
                at, value = at + 1, -value
            if digits >= 0:
                at = _put_fixed(text, at, np.int64(np.rint(value * 10.0**digits)), digits)
            elif value == 0:
                at = _put_digits(text, at, 0, 1)
            else:
                at = _put_general(text, at, value, -digits)
        text[at] = _COMMA
        at += 1
        for letter in names[status[row]]:
            if letter != 0:
                text[at] = letter
                at += 1
        text[at] = _END
        at += 1
    return at
