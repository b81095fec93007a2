"""``navreplay init``: a commented configuration filled with what the logs show."""

import argparse

from importers.inspection import Inspection, draft_mappings, inspect_logs
from importers.roles.selection import SETTING
from navreplay.timeline import LogError
from pipelines.commands.options import read_config
from pipelines.config.spec import load_config
from pipelines.config.template import commented_template
from pipelines.files.destination import check_file

__all__ = ["run"]


def run(arguments: argparse.Namespace) -> None:
    """Writes the configuration. Raises LogError for logs that cannot be opened or a file that cannot be written."""
    check_file(arguments.out, arguments.force)
    settings = read_config(arguments).input
    inspection = inspect_logs(arguments.logs, settings)
    config = load_config(arguments.config, [*_found(inspection), *arguments.sets])
    drafts = draft_mappings(arguments.logs, settings, inspection)
    if config.input.message or config.input.csv:  # written out above, and no table of TOML is told twice
        drafts = [f"# {line}".rstrip() for line in drafts]
    text = commented_template(config, _notes(inspection)) + "".join(f"{line}\n" for line in drafts)
    try:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{arguments.out}: cannot be written: {error.strerror}") from error
    logs = " ".join(str(log) for log in arguments.logs)
    print(f"{arguments.out}: edit it, then: navreplay run {logs} -c {arguments.out} -o OUT")


def _found(inspection: Inspection) -> list[str]:
    """Settings that name the channels found, and what was recognised of them."""
    channels = {SETTING[channel.role]: channel.name for channel in inspection.channels if channel.role in SETTING}
    return [f'{key}="{value}"' for key, value in (channels | dict(inspection.recognised)).items()]


def _notes(inspection: Inspection) -> list[str]:
    notes = [f"Configuration for {', '.join(file.path for file in inspection.files)}, written by navreplay init."]
    notes += ["Every key can be left out; what is shown is then taken. Vectors of the body are forward, right, down."]
    notes += [f"Assumed: {text}" for text in inspection.assumptions]
    for role, names in inspection.candidates.items():
        notes.append(f"To decide: {SETTING[role]} = one of {', '.join(names)}")
    return notes + [f"{finding.level.capitalize()}: {finding.text} {finding.hint}".rstrip() for finding in inspection.findings]
