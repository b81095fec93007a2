"""What all container readers share: from channel names to tables, and errors that name file and channel."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches

from importers.decoding.blocks import Block, Decoder, Loss, TableBuilder, collect
from importers.rows.log import Channel, Table
from navreplay.timeline import LogError

__all__ = ["read_tables", "require_channels"]

_LISTED = 12


def require_channels(path: str, names: Sequence[str], channels: Sequence[Channel]) -> None:
    """Raises LogError for the first name that is no channel of the log."""
    known = [channel.name for channel in channels]
    for name in names:
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0]}?" if near else "it has " + (", ".join(known[:_LISTED]) or "no channels at all")
            raise LogError(f"{path}: no channel {name} in this log; {hint}")


def read_tables(
    path: str,
    numbers: Mapping[str, Sequence[int]],
    decoder: Callable[[int], Decoder],
    messages: Callable[[set[int]], Iterable[Block | Loss]],
    counts: Mapping[int, int] | None,
) -> dict[str, Table]:
    """Tables by name, in one pass.

    numbers: the container's channel numbers under each name. decoder: makes the decoder of a number; its LogError is told
    with file and channel. messages: yields the blocks of the numbers given. counts: messages that the file's index promises
    per number; those that did not turn up are rejected as lost to damage.
    """
    decoders: dict[int, Decoder] = {}
    for name, members in numbers.items():
        for number in members:
            try:
                decoders[number] = decoder(number)
            except LogError as error:
                raise LogError(f"{path}: channel {name}: {error}") from error
    promised = {name: sum((counts or {}).get(number, 0) for number in members) for name, members in numbers.items()}
    by_name = {name: TableBuilder(promised[name]) for name in numbers}
    builders = {number: by_name[name] for name, members in numbers.items() for number in members}
    collect(builders, decoders, messages(set(builders)))
    for name, builder in by_name.items():
        builder.lose(promised[name] - builder.read, "lost to damage in the file")
    return {name: builder.table() for name, builder in by_name.items()}
