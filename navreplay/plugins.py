"""What other packages add: objects registered under an entry point group, loaded when they are first asked for.

A package registers them in its pyproject.toml, for example
    [project.entry-points."navreplay.filters"]
    my-method = "my_package.my_file:MY_PRESET"
"""

import logging
from collections.abc import Collection, Iterable
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import TypeVar

from navreplay.timeline import LogError

__all__ = ["load_plugins", "told", "told_apart"]

T = TypeVar("T")
_LOGGER = logging.getLogger("navreplay")


@cache
def load_plugins(group: str, *kinds: type) -> tuple[object, ...]:
    """The objects of a group, each an instance of one of kinds, in the order of their names. Raises LogError with package and
    object for one that cannot be loaded, or that is something else."""
    return tuple(_load(point, kinds) for point in sorted(entry_points(group=group), key=lambda point: point.name))


def told_apart(group: str, added: Iterable[T], known: Collection[str]) -> list[T]:
    """Those whose name no built-in has; the others are left out, with a line of warning each, once."""
    kept = []
    for one in added:
        name = str(getattr(one, "name", ""))
        if name in known:
            _warn_of_name(group, name)
        else:
            kept.append(one)
    return kept


@cache
def _warn_of_name(group: str, name: str) -> None:
    _LOGGER.warning(
        f"warning: a plug-in of '{group}' is named '{name}' as one that is built in, which counts; rename the plug-in"
    )


def _load(point: EntryPoint, kinds: tuple[type, ...]) -> object:
    package = _package(point)
    try:
        found = point.load()
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises, the user is told whose it is
        raise LogError(
            f"plug-in '{point.name}' ({point.value}) of {package} cannot be loaded: {told(error)}; mend or "
            "uninstall that package"
        ) from error
    if not isinstance(found, kinds):
        raise LogError(
            f"plug-in '{point.name}' ({point.value}) of {package} is no {' or '.join(kind.__name__ for kind in kinds)}; see "
            f"docs/recipes.md for what "
            f"'{point.group}' takes"
        )
    return found


def _package(point: EntryPoint) -> str:
    return "an unnamed package" if point.dist is None else f"package '{point.dist.name}'"


def told(error: BaseException) -> str:
    """What a stranger's code raised, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
