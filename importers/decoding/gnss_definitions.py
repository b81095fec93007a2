"""Definitions of messages with raw GNSS data, for ROS 2 bags that hold none.

Fields as in gnss_comm (https://github.com/HKUST-Aerial-Robotics/gnss_comm) and in the ROS 2 version of ublox_msgs
(https://github.com/KumarRobotics/ublox).
"""

__all__ = ["DEFINITIONS"]


def _fields(kind: str, names: str) -> str:
    return "".join(f"{kind} {name}\n" for name in names.split())


def _gnss_comm(package: str) -> dict[str, str]:
    name = f"{package}/msg/"
    return {
        f"{name}GnssTimeMsg": "uint32 week\nfloat64 tow\n",
        f"{name}GnssObsMsg": "GnssTimeMsg time\nuint32 sat\n"
        + _fields("float64[]", "freqs CN0")
        + _fields("uint8[]", "LLI code")
        + _fields("float64[]", "psr psr_std cp cp_std dopp dopp_std")
        + "uint8[] status\n",
        f"{name}GnssMeasMsg": "GnssObsMsg[] meas\n",
        f"{name}GnssEphemMsg": "uint32 sat\n"
        + _fields("GnssTimeMsg", "ttr toe toc")
        + "float64 toe_tow\n"
        + _fields("uint32", "week iode iodc health code")
        + _fields("float64", "ura A e i0 omg OMG0 M0 delta_n OMG_dot i_dot cuc cus crc crs cic cis af0 af1 af2")
        + _fields("float64", "tgd0 tgd1 A_dot n_dot"),
        f"{name}GnssGloEphemMsg": "uint32 sat\n"
        + _fields("GnssTimeMsg", "ttr toe")
        + "int32 freqo\n"
        + _fields("uint32", "iode health age")
        + _fields("float64", "ura pos_x pos_y pos_z vel_x vel_y vel_z acc_x acc_y acc_z tau_n gamma delta_tau_n"),
        f"{name}StampedFloat64Array": "std_msgs/Header header\nfloat64[] data\n",
    }


_UBLOX = {
    "ublox_msgs/msg/RxmRAWXMeas": _fields("float64", "pr_mes cp_mes")
    + "float32 do_mes\n"
    + _fields("uint8", "gnss_id sv_id reserved0 freq_id")
    + "uint16 locktime\nint8 cno\n"
    + _fields("uint8", "pr_stdev cp_stdev do_stdev trk_stat reserved1"),
    "ublox_msgs/msg/RxmRAWX": "float64 rcv_tow\nuint16 week\nint8 leap_s\n"
    + _fields("uint8", "num_meas rec_stat version")
    + "uint8[2] reserved1\nRxmRAWXMeas[] meas\n",
    "ublox_msgs/msg/RxmSFRBX": _fields("uint8", "gnss_id sv_id reserved0 freq_id num_words chn version reserved1")
    + "uint32[] dwrd\n",
}

DEFINITIONS: dict[str, str] = {**_gnss_comm("gnss_comm"), **_gnss_comm("gnss_comm_msgs"), **_UBLOX}
"""By the ROS 2 name of the type."""
