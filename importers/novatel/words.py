"""The words that stand for numbers in ASCII messages of NovAtel receivers.

Source: NovAtel OEM7 Commands and Logs Reference Manual: tables of solution status, position or velocity type, and inertial
solution status.
"""

__all__ = ["WORDS"]

_SOLUTION = {
    "SOL_COMPUTED": 0, "INSUFFICIENT_OBS": 1, "NO_CONVERGENCE": 2, "SINGULARITY": 3, "COV_TRACE": 4, "TEST_DIST": 5,
    "COLD_START": 6, "V_H_LIMIT": 7, "VARIANCE": 8, "RESIDUALS": 9, "INTEGRITY_WARNING": 13, "PENDING": 18, "INVALID_FIX": 19,
    "UNAUTHORIZED": 20, "INVALID_RATE": 22,
}  # fmt: skip
_TYPE = {
    "NONE": 0, "FIXEDPOS": 1, "FIXEDHEIGHT": 2, "DOPPLER_VELOCITY": 8, "SINGLE": 16, "PSRDIFF": 17, "WAAS": 18,
    "PROPAGATED": 19, "L1_FLOAT": 32, "NARROW_FLOAT": 34, "L1_INT": 48, "WIDE_INT": 49, "NARROW_INT": 50,
    "RTK_DIRECT_INS": 51, "INS_SBAS": 52, "INS_PSRSP": 53, "INS_PSRDIFF": 54, "INS_RTKFLOAT": 55, "INS_RTKFIXED": 56,
    "PPP_CONVERGING": 68, "PPP": 69, "OPERATIONAL": 70, "WARNING": 71, "OUT_OF_BOUNDS": 72, "INS_PPP_CONVERGING": 73,
    "INS_PPP": 74, "PPP_BASIC_CONVERGING": 77, "PPP_BASIC": 78, "INS_PPP_BASIC_CONVERGING": 79, "INS_PPP_BASIC": 80,
}  # fmt: skip
_INERTIAL = {
    "INS_INACTIVE": 0, "INS_ALIGNING": 1, "INS_HIGH_VARIANCE": 2, "INS_SOLUTION_GOOD": 3, "INS_SOLUTION_FREE": 6,
    "INS_ALIGNMENT_COMPLETE": 7, "DETERMINING_ORIENTATION": 8, "WAITING_INITIALPOS": 9, "WAITING_AZIMUTH": 10,
    "INITIALIZING_BIASES": 11, "MOTION_DETECT": 12,
}  # fmt: skip
_DATUM = {"WGS84": 61, "USER": 63}
_NAMED = _SOLUTION | _TYPE | _INERTIAL | _DATUM
WORDS: dict[bytes, int] = {name.encode(): number for name, number in _NAMED.items()}
"""The number of each word, as in the binary messages."""
