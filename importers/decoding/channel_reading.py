"""What all container readers share: from channel names to tables, and errors that name file and channel."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches

import numpy as np

from importers.decoding.blocks import Block, Buffer, Decoded, Decoder, Loss, Offsets, TableBuilder, collect
from importers.rows.log import Channel, Log, Table
from navreplay.timeline import LogError

__all__ = ["name_numbers", "read_channels", "read_tables", "require_channels"]

_LISTED = 12


def require_channels(path: str, names: Sequence[str], channels: Sequence[Channel]) -> None:
    """Raises LogError for the first name that is no channel of the log."""
    known = [channel.name for channel in channels]
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else "it has " + (", ".join(known[:_LISTED]) or "no channels at all")
            raise LogError(f"{path}: no channel {name} in this log; {hint}")


def name_numbers(channels: Iterable[tuple[int, str, str]]) -> dict[str, list[int]]:
    """The container's numbers by channel name, of number, topic and type: those of one topic and type are one channel, named as
    the topic; another type on the same topic is a channel of its own, ``topic#type``."""
    first: dict[str, str] = {}
    numbers: dict[str, list[int]] = {}
    for number, topic, type in channels:
        same = first.setdefault(topic, type) == type
        numbers.setdefault(topic if same else f"{topic}#{type or 'unknown'}", []).append(number)
    return numbers


def read_channels(
    log: Log,
    names: Sequence[str],
    numbers: Mapping[str, Sequence[int]],
    decoder: Callable[[int], Decoder],
    messages: Callable[[set[int]], Iterable[Block | Loss]],
    counts: Mapping[int, int] | None,
) -> dict[str, Table]:
    """Tables of the channels named, of all that `read_tables` takes. Raises LogError for a name that is no channel."""
    require_channels(log.path, names, log.channels())
    return read_tables({name: numbers[name] for name in names}, decoder, messages, counts)


def read_tables(
    numbers: Mapping[str, Sequence[int]],
    decoder: Callable[[int], Decoder],
    messages: Callable[[set[int]], Iterable[Block | Loss]],
    counts: Mapping[int, int] | None,
) -> dict[str, Table]:
    """Tables by name, in one pass.

    numbers: the container's channel numbers under each name. decoder: makes the decoder of a number; where it raises LogError,
    the messages of that number are rejected for what the error says, and no other channel loses anything. messages: yields
    the blocks of the numbers given. counts: messages that the file's index promises per number; those that did not turn up
    are rejected as lost to damage.
    """
    decoders = {number: _decoder_or_refusal(decoder, number) for members in numbers.values() for number in members}
    promised = {name: sum((counts or {}).get(number, 0) for number in members) for name, members in numbers.items()}
    by_name = {name: TableBuilder(promised[name]) for name in numbers}
    builders = {number: by_name[name] for name, members in numbers.items() for number in members}
    collect(builders, decoders, messages(set(builders)))
    for name, builder in by_name.items():
        builder.lose(promised[name] - builder.read, "lost to damage in the file")
    return {name: builder.table() for name, builder in by_name.items()}


class _Refusal:
    """In place of a decoder that cannot be made: rejects every message for the same reason."""

    def __init__(self, reason: str) -> None:
        self._reason = reason

    def decode(self, buffer: Buffer, start: Offsets, stop: Offsets) -> Decoded:
        """See `Decoder`."""
        return Decoded({}, np.empty(0, dtype=np.intp), self._reason)


def _decoder_or_refusal(decoder: Callable[[int], Decoder], number: int) -> Decoder:
    try:
        return decoder(number)
    except LogError as error:
        return _Refusal(str(error))
