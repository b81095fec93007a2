"""A progress bar on standard error, for runs that take more than two seconds."""

from collections.abc import Iterator
from contextlib import contextmanager

from pipelines.drive.process import Progress

__all__ = ["show_progress"]


@contextmanager
def show_progress(quiet: bool) -> Iterator[Progress | None]:
    """A bar over the stages of a run; none when quiet or when nobody watches (standard error is not a terminal)."""
    if quiet:
        yield None
        return
    from tqdm import tqdm

    bar_format = "{desc:<12}{percentage:3.0f}%|{bar}| {elapsed}"
    with tqdm(total=1.0, bar_format=bar_format, delay=2, miniters=0, disable=None, leave=False) as bar:

        def tell(stage: str, fraction: float) -> None:
            """See `Progress`."""
            bar.set_description_str(stage, refresh=False)
            bar.update(fraction - bar.n)

        yield tell
