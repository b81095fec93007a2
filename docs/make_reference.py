"""A page of the reference per room, from the docstrings of its public modules; run by MkDocs (gen-files)."""

from pathlib import Path

import mkdocs_gen_files

ROOT = Path(__file__).parents[1]
index = ["# Reference", "", "A page per room, in the words of the code.", ""]

for package in ("navreplay", "importers", "pipelines", "synthetic_logs"):
    for init in sorted((ROOT / package).rglob("__init__.py")):
        room = ".".join(init.parent.relative_to(ROOT).parts)
        modules = sorted(path.stem for path in init.parent.glob("*.py") if not path.stem.startswith("_"))
        lines = [f"# {room}", "", f"::: {room}", "    options:", "      members: false", ""]
        for module in modules:
            lines += [f"## {module}", "", f"::: {room}.{module}", ""]
        with mkdocs_gen_files.open(f"reference/{room}.md", "w") as page:
            page.write("\n".join(lines))
        index.append(f"- [{room}]({room}.md)")

with mkdocs_gen_files.open("reference/index.md", "w") as page:
    page.write("\n".join(index) + "\n")
