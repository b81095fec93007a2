"""Delays of satellite signals in the atmosphere, by broadcast and standard models; look angles.

Ionosphere: Klobuchar, IS-GPS-200N (2022), 20.3.3.5.2.5, and BeiDou's variant of it, BDS-SIS-ICD-B1I-3.0, 5.2.4.7.
Troposphere: Saastamoinen, Atmospheric correction for the troposphere and stratosphere in radio ranging of satellites,
Geophysical Monograph 15 (1972) 247, with the ICAO standard atmosphere at a relative humidity of 70 %. Everything broadcasts
over leading dimensions.
"""

import numpy as np
from numpy.typing import ArrayLike

from navreplay.geodesy import earth
from navreplay.timeline import Floats

__all__ = ["SPEED_OF_LIGHT", "beidou_delay", "klobuchar_delay", "look_angles", "saastamoinen_delay"]

SPEED_OF_LIGHT = 299_792_458.0
"""[m/s]."""

_HUMIDITY = 0.7
_LEAST_ELEVATION = np.radians(2.0)
"""The models divide by the sine of the elevation: below this they are held."""
_HIGHEST = 20_000.0
_DAY = 86400.0
_NIGHT_DELAY = 5e-9
_PEAK = 50400.0
_SHORTEST_PERIOD = 72000.0
_LONGEST_BEIDOU_PERIOD = 172_800.0
_SHELL_RATIO = 6378.0 / (6378.0 + 375.0)
"""Of the radii of the Earth and of BeiDou's ionosphere."""
_B1I_OVER_L1 = 1561.098 / 1575.42


def look_angles(antenna_lla: Floats, sat_pos_e: Floats) -> tuple[Floats, Floats]:
    """Elevation and azimuth clockwise from north (...) [rad] of satellites at sat_pos_e (..., 3) [m, Earth-fixed] from
    antenna_lla (..., 3)."""
    towards_e = sat_pos_e - earth.ecef_from_lla(antenna_lla)
    c_en = earth.matrix_en(antenna_lla[..., 0], antenna_lla[..., 1])
    north, east, down = np.moveaxis(np.einsum("...ji,...j->...i", c_en, towards_e), -1, 0)
    return np.arctan2(-down, np.hypot(north, east)), np.arctan2(east, north)


def klobuchar_delay(
    coefficients: Floats, lat: ArrayLike, lon: ArrayLike, elevation: ArrayLike, azimuth: ArrayLike, tow_s: ArrayLike
) -> Floats:
    """Delay (...) [m] at L1 (1575.42 MHz); at another carrier f it is (1575.42 MHz / f)^2 times that.

    coefficients: (8,) broadcast alpha0..3 [s, s/semicircle, ...] and beta0..3. Angles [rad], tow_s: GPS time of week [s].
    """
    lat, lon, e, azimuth = (np.asarray(angle, dtype=np.float64) / np.pi for angle in (lat, lon, elevation, azimuth))
    e = np.maximum(e, 0.0)
    central = 0.0137 / (e + 0.11) - 0.022
    pierce_lat = np.clip(lat + central * np.cos(azimuth * np.pi), -0.416, 0.416)
    pierce_lon = lon + central * np.sin(azimuth * np.pi) / np.cos(pierce_lat * np.pi)
    magnetic = pierce_lat + 0.064 * np.cos((pierce_lon - 1.617) * np.pi)
    local = (43200.0 * pierce_lon + np.asarray(tow_s, dtype=np.float64)) % _DAY
    powers = magnetic[..., None] ** np.arange(4)
    amplitude = np.maximum(powers @ coefficients[:4], 0.0)
    period = np.maximum(powers @ coefficients[4:], _SHORTEST_PERIOD)
    phase = 2 * np.pi * (local - _PEAK) / period
    day = np.where(np.abs(phase) < 1.57, amplitude * (1 - phase**2 / 2 + phase**4 / 24), 0.0)
    slant = 1.0 + 16.0 * (0.53 - e) ** 3
    return np.asarray(SPEED_OF_LIGHT * slant * (_NIGHT_DELAY + day))


def beidou_delay(
    coefficients: Floats, lat: ArrayLike, lon: ArrayLike, elevation: ArrayLike, azimuth: ArrayLike, tow_s: ArrayLike
) -> Floats:
    """The same from BeiDou's coefficients, which hold at geographic latitudes, in a shell 375 km high, for B1I (1561.098 MHz);
    the delay is that at L1. Up to 14 s in tow_s are of no matter."""
    lat, lon, e, azimuth = (np.asarray(angle, dtype=np.float64) for angle in (lat, lon, elevation, azimuth))
    sine = _SHELL_RATIO * np.cos(np.maximum(e, 0.0))
    central = np.pi / 2 - np.maximum(e, 0.0) - np.arcsin(sine)
    pierce_lat = np.arcsin(np.sin(lat) * np.cos(central) + np.cos(lat) * np.sin(central) * np.cos(azimuth))
    pierce_lon = lon + np.arctan2(
        np.sin(central) * np.sin(azimuth) * np.cos(lat), np.cos(central) - np.sin(lat) * np.sin(pierce_lat)
    )
    local = (43200.0 / np.pi * pierce_lon + np.asarray(tow_s, dtype=np.float64)) % _DAY
    powers = np.abs(pierce_lat / np.pi)[..., None] ** np.arange(4)
    amplitude = np.maximum(powers @ coefficients[:4], 0.0)
    period = np.clip(powers @ coefficients[4:], _SHORTEST_PERIOD, _LONGEST_BEIDOU_PERIOD)
    apart = local - _PEAK
    day = np.where(np.abs(apart) < period / 4, amplitude * np.cos(2 * np.pi * apart / period), 0.0)
    return np.asarray(SPEED_OF_LIGHT * _B1I_OVER_L1**2 * (_NIGHT_DELAY + day) / np.sqrt(1 - sine**2))


def saastamoinen_delay(lat: ArrayLike, height: ArrayLike, elevation: ArrayLike) -> Floats:
    """Delay (...) [m] of a signal from elevation [rad], at latitude [rad] and height [m] (the ellipsoidal one will do)."""
    lat = np.asarray(lat, dtype=np.float64)
    height = np.clip(np.asarray(height, dtype=np.float64), 0.0, _HIGHEST)
    pressure = 1013.25 * (1 - 2.2557e-5 * height) ** 5.2568
    kelvin = 15.0 - 6.5e-3 * height + 273.15
    vapour = 6.108 * _HUMIDITY * np.exp((17.15 * kelvin - 4684.0) / (kelvin - 38.45))
    dry = 0.0022768 * pressure / (1 - 0.00266 * np.cos(2 * lat) - 2.8e-7 * height)
    wet = 0.002277 * (1255.0 / kelvin + 0.05) * vapour
    return np.asarray((dry + wet) / np.sin(np.maximum(elevation, _LEAST_ELEVATION)))
