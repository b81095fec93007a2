"""One drive through several methods, each with the configuration as it is or with one key of it at several values."""

import json
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from navreplay.filters.presets import PRESETS, build_method
from navreplay.timeline import LogError
from pipelines.config.spec import Config
from pipelines.drive.process import Drive, Progress, filter_drive, read_drive
from pipelines.drive.result import RunResult

__all__ = ["Outcome", "Setting", "Variant", "compare", "name_methods", "number_equal", "plan_variants"]

_SLOW = ("ml-ga", "mlckf-ga")
_LONGEST_FOLDER = 80


@dataclass(frozen=True, slots=True)
class Setting:
    """A configuration for all methods, and the value that key has in it; no key where none is varied."""

    config: Config
    key: str = ""
    value: object = None

    def __str__(self) -> str:
        value = self.value if isinstance(self.value, str) else json.dumps(self.value)
        return f"{self.key.rpartition('.')[2]} {value}"


@dataclass(frozen=True, slots=True)
class Variant:
    """One run of a comparison. label: of its rows; folder: name of that for its outputs; no two are equal. setting: what its
    config was made of."""

    label: str
    folder: str
    config: Config
    setting: Setting


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """What became of a variant: its result, or why it has none."""

    variant: Variant
    result: RunResult | LogError


def name_methods(text: str) -> tuple[str, ...]:
    """The names in a list with commas; ``all`` stands for every method but the slow ones. Raises LogError for an empty list."""
    names: list[str] = []
    for name in text.split(","):
        if name.strip() == "all":
            names += [known for known in PRESETS if known not in _SLOW]
        elif name.strip():
            names.append(name.strip())
    if not names:
        raise LogError("compare: --filters names no method; 'navreplay filters' lists them")
    return tuple(names)


def plan_variants(names: Sequence[str], settings: Sequence[Setting]) -> tuple[Variant, ...]:
    """Every method in every setting, method by method, the rest of the configuration the same.

    Parameters in the configuration go to the method it names, a varied one to all; beside these the others run with their
    defaults. Raises LogError for an unknown method or a parameter that does not fit it.
    """
    pairs = [(name, setting) for name in names for setting in settings]
    labels = number_equal([_label(name, setting) for name, setting in pairs])
    folders = number_equal([re.sub(r"[^\w.+-]+", "-", label)[:_LONGEST_FOLDER] for label in labels])
    variants = tuple(
        Variant(label, folder, _with_filter(setting, name), setting)
        for label, folder, (name, setting) in zip(labels, folders, pairs, strict=True)
    )
    for variant in variants:
        build_method(variant.config.filter.name, variant.config.filter.parameters)
    return variants


def compare(paths: Sequence[Path], variants: Sequence[Variant], progress: Progress | None = None) -> Iterator[Outcome]:
    """The drive, read once, through each variant; one at a time, since a result is large.

    Raises LogError for logs that cannot be read or that preflight refuses. A variant that cannot run on them is an outcome.
    """
    drive = read_drive(paths, variants[0].config, progress)
    for number, variant in enumerate(variants, start=1):
        yield Outcome(variant, _attempt(drive, variant.config, _counted(progress, f"{number}/{len(variants)}")))


def number_equal(texts: Sequence[str]) -> tuple[str, ...]:
    """The texts, numbered where one occurs twice; no two are equal."""
    counts, taken, numbered = Counter(texts), set(texts), []
    for i, text in enumerate(texts):
        number = texts[: i + 1].count(text)
        unique = text if counts[text] == 1 else f"{text}-{number}"
        while unique != text and unique in taken:
            number += 1
            unique = f"{text}-{number}"
        taken.add(unique)
        numbered.append(unique)
    return tuple(numbered)


def _label(name: str, setting: Setting) -> str:
    name = f"{name}-smoothed" if setting.config.filter.smooth else name
    return f"{name}, {setting}" if setting.key else name


def _with_filter(setting: Setting, name: str) -> Config:
    config = setting.config
    if name == config.filter.name:
        return config
    kept = setting.key.removeprefix("filter.parameters.")
    parameters = {key: value for key, value in config.filter.parameters.items() if key == kept}
    return config.model_copy(update={"filter": config.filter.model_copy(update={"name": name, "parameters": parameters})})


def _attempt(drive: Drive, config: Config, progress: Progress | None) -> RunResult | LogError:
    try:
        return filter_drive(drive, config, progress)
    except LogError as error:
        return error


def _counted(progress: Progress | None, count: str) -> Progress | None:
    """progress with the count before the name of the stage."""
    return None if progress is None else lambda stage, fraction: progress(f"{count} {stage}", fraction)
