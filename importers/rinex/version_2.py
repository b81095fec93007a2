"""RINEX 2 rewritten as RINEX 3, line by line, so that one reader serves both.

Source: RINEX 2.11 (W. Gurtner and L. Estey, 2007), tables A1 to A4, A10 and A11, and of RINEX 3.05 chapter 5.1 on signals.
Types of version 2 count for all systems; in version 3 each system has its own.
"""

from collections.abc import Iterator, Sequence

__all__ = ["modern_navigation", "modern_observation"]

_LABEL = 60
_PER_LINE, _STRIDE, _WIDTH = 5, 16, 80
_SATELLITES_PER_LINE, _FIRST_SATELLITE = 12, 32
_CODES = {
    "G": {"C1": "1C", "P1": "1W", "CA": "1C", "CB": "1X", "C2": "2X", "CC": "2X", "P2": "2W", "C5": "5X"},
    "R": {"C1": "1C", "P1": "1P", "CA": "1C", "C2": "2C", "CD": "2C", "P2": "2P"},
    "E": {"C1": "1X", "CA": "1X", "C5": "5X", "C6": "6X", "C7": "7X", "C8": "8X"},
    "C": {"C1": "2I", "C2": "2I", "C6": "6I", "C7": "7I"},
    "J": {"C1": "1C", "CA": "1C", "CB": "1X", "C2": "2X", "CC": "2X", "C5": "5X", "C6": "6X"},
    "S": {"C1": "1C", "CA": "1C", "C5": "5X"},
}
"""By system and type of pseudorange, its signal in version 3."""
_BANDS = {"1": ("C1", "CA", "P1"), "2": ("C2", "CC", "P2"), "5": ("C5",), "6": ("C6",), "7": ("C7",), "8": ("C8",)}
"""The pseudorange whose signal the Doppler and signal strength of a band are taken to be of."""
_NAVIGATION_SYSTEMS = {"N": "G", "G": "R", "H": "S", "E": "E"}
_FLAGS, _EVENTS = "0123456", "2345"


def modern_observation(text: str) -> str:
    """An observation file of version 2 as one of version 3."""
    lines = text.split("\n")
    end = next((row for row, line in enumerate(lines) if line[_LABEL:].startswith("END OF HEADER")), len(lines))
    system = lines[0][40:41].strip() or "G"
    types: list[str] = []
    header = _modern_header(lines[:end], types)
    body = _modern_body(lines[end + 1 :], types, "G" if system == "M" else system)
    first = f"{3.05:9.2f}{lines[0][9:20]}{lines[0][20:40]}{system:<20}RINEX VERSION / TYPE"
    return "\n".join([first, *header[1:], *lines[end : end + 1], *body, ""])


def _modern_header(lines: Sequence[str], types: list[str]) -> list[str]:
    """Header lines, or those of an event, with the types of each system in place of those of all; types is brought up to
    date."""
    told = [line for line in lines if line[_LABEL:].startswith("# / TYPES OF OBSERV")]
    if told:
        types[:] = "".join(f" {line[6:_LABEL]}" for line in told).split()
    kept = [line for line in lines if not line[_LABEL:].startswith("# / TYPES OF OBSERV")]
    number = told[0][:6].strip() if told else ""
    return kept + (list(_type_lines(types, number)) if told else [])


def _type_lines(types: Sequence[str], number: str) -> Iterator[str]:
    """SYS / # / OBS TYPES of every system. number: of the types, as the file tells it."""
    for system in _CODES:
        names = _modern_types(types, system)
        for start in range(0, len(names), 13):
            head = f"{system}{number:>5}" if start == 0 else " " * 6
            listed = "".join(f" {name}" for name in names[start : start + 13])
            yield f"{head}{listed}".ljust(_LABEL) + "SYS / # / OBS TYPES"


def _modern_types(types: Sequence[str], system: str) -> list[str]:
    """The types of version 3 that stand in the columns of types (k,) for a system; ``---`` in a column that is not read."""
    codes = _CODES[system]
    names: list[str] = []
    for kind in types:
        name = "---"
        if kind in codes:
            name = f"C{codes[kind]}"
        elif kind[:1] in ("D", "S", "L") and kind[1:] in _BANDS:
            first = next((code for code in _BANDS[kind[1:]] if code in types and code in codes), None)
            name = "---" if first is None else f"{kind[0]}{codes[first]}"
        names.append("---" if name in names else name)
    return names


def _modern_body(lines: Sequence[str], types: list[str], blank: str) -> Iterator[str]:
    """Epochs, satellites and events. blank: the system of satellites without a letter. Lines where an epoch should begin and
    none does are passed on under an epoch without a time."""
    row, lost = 0, False
    while row < len(lines):
        line = lines[row]
        row += 1
        if not line.strip() or line[_LABEL:].strip() == "COMMENT":
            continue
        if not _is_epoch(line):
            yield from [f"?{line[:_STRIDE]}"] if lost else [">", f"?{line[:_STRIDE]}"]
            lost = True
            continue
        lost = False
        count = int(line[29:32].strip() or 0)
        if line[28] in _EVENTS:
            event = _modern_header(lines[row : row + count], types)
            row += count
            yield f">{' ' * 30}{line[28]}{len(event):3d}"
            yield from event
            continue
        names, row = _satellites(lines, row - 1, count, blank)
        yield f"> {_year(line[1:3])}{line[3:29]}{count:3d}"
        each = -(-len(types) // _PER_LINE)
        for name in names:
            parts = lines[row : row + each]
            if any(_is_epoch(part) for part in parts):
                break  # the number of satellites is damaged, or lines are lost; no line of observations looks like an epoch's
            row += each
            yield (name + "".join(part.ljust(_WIDTH)[:_WIDTH] for part in parts)).rstrip()


def _year(digits: str) -> str:
    digits = digits.replace(" ", "0")
    return ("19" if digits >= "80" else "20") + digits


def _is_epoch(line: str) -> bool:
    """Whether a line is an epoch's or an event's: a flag and a number, and a date and time, which events may lack."""
    flag, count = line[28:29], line[29:32].strip()
    if line[:1] != " " or line[26:28].strip() or flag not in _FLAGS or not (count.isascii() and count.isdigit()):
        return flag in _EVENTS and flag != "" and not line[:28].strip() and not count
    return flag in _EVENTS or (line[18:19] == "." and line[1:3].strip().isdigit() and line[3:4] == " ")


def _satellites(lines: Sequence[str], row: int, count: int, blank: str) -> tuple[list[str], int]:
    """The satellites of the epoch in line row, and the row behind their list."""
    listed = ""
    for _ in range(max(-(-count // _SATELLITES_PER_LINE), 1)):
        part = lines[row] if row < len(lines) else ""
        listed += part[_FIRST_SATELLITE : _FIRST_SATELLITE + 3 * _SATELLITES_PER_LINE].ljust(3 * _SATELLITES_PER_LINE)
        row += 1
    names = [listed[3 * i : 3 * i + 3] for i in range(count)]
    return [(blank if name[0] == " " else name[0]) + name[1:].replace(" ", "0") for name in names], row


def modern_navigation(text: str) -> str:
    """A navigation file of version 2 as one of version 3; records that are none are left to the reader."""
    lines = text.split("\n")
    end = next((row for row, line in enumerate(lines) if line[_LABEL:].startswith("END OF HEADER")), len(lines))
    system = _NAVIGATION_SYSTEMS.get(lines[0][20:21], "G")
    header = [f"{3.05:9.2f}{'':11}{'N: GNSS NAV DATA':<20}{system:<20}RINEX VERSION / TYPE"]
    for line in lines[1:end]:
        for label, name in (("ION ALPHA", "GPSA"), ("ION BETA", "GPSB")):
            if line[_LABEL:].startswith(label):
                line = f"{name} {line[2:50]}".ljust(_LABEL) + "IONOSPHERIC CORR"
        header.append(line)
    return "\n".join([*header, *lines[end : end + 1], *_modern_records(lines[end + 1 :], system), ""])


def _modern_records(lines: Sequence[str], system: str) -> Iterator[str]:
    """Records with the satellite and the year in full; their numbers stand one column further right."""
    for line in lines:
        if line[:3].strip():
            letter, number = (line[0], line[1:3]) if line[0].isalpha() else (system, line[:2])
            yield f"{letter}{number.strip().zfill(2)} {_year(line[3:5])}{line[5:20]}{line[22:]}"
        else:
            yield f" {line}"
