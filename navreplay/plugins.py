"""What other packages add: objects registered under an entry point group, loaded when they are first asked for.

A package registers them in its pyproject.toml, for example
    [project.entry-points."navreplay.filters"]
    my-method = "my_package.my_file:MY_PRESET"
"""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from navreplay.timeline import LogError

__all__ = ["load_plugins"]


@cache
def load_plugins(group: str, kind: type) -> tuple[object, ...]:
    """The objects of a group, each an instance of kind, in the order of their names. Raises LogError with package and object
    for one that cannot be loaded, or that is something else."""
    return tuple(_load(point, kind) for point in sorted(entry_points(group=group), key=lambda point: point.name))


def _load(point: EntryPoint, kind: type) -> object:
    package = "an unnamed package" if point.dist is None else f"package '{point.dist.name}'"
    try:
        found = point.load()
    except Exception as error:  # whatever a stranger's module raises, the user is told whose it is
        raise LogError(
            f"plug-in '{point.name}' ({point.value}) of {package} cannot be loaded: {type(error).__name__}: {error}; mend or "
            "uninstall that package"
        ) from error
    if not isinstance(found, kind):
        raise LogError(
            f"plug-in '{point.name}' ({point.value}) of {package} is no {kind.__name__}; see docs/recipes.md for what "
            f"'{point.group}' takes"
        )
    return found
