"""Pages of reference that are made of the program itself, so that they cannot be out of date."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from escaping import escape
from typer.main import get_command

from mcnav.cli import app

ROOT: Final = Path(__file__).resolve().parent.parent.parent


def walk(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield every command under a group of them, with its whole name."""
    for word, each in getattr(command, "commands", {}).items():
        if hasattr(each, "commands"):
            yield from walk(each, f"{name} {word}")
        else:
            yield f"{name} {word}", each


def commands() -> str:
    """Write the page of all commands, as their ``--help`` has them."""
    parts = ["# Options of every command", "As `--help` prints them. [Commands](/commands.md) has what they are for."]
    for name, command in walk(get_command(app), "mcnav"):
        context = command.context_class(command, info_name=name)
        usage = command.get_usage(context).removeprefix("Usage: ")
        records = [record for each in command.get_params(context) if (record := each.get_help_record(context))]
        parts += [f"## {name}", f"```text\n{usage}\n```", help_text(command.help or "")]
        rows = "\n".join(
            f"| `{option.replace('|', chr(92) + '|')}` | {escape(meaning)} |" for option, meaning in records
        )
        parts.append(f"| argument or option | meaning |\n| --- | --- |\n{rows}")
    return "\n\n".join(parts) + "\n"


def help_text(text: str) -> str:
    """Turn a command's help into Markdown; its example becomes code."""
    paragraphs = []
    for paragraph in text.strip().split("\n\n"):
        words, _, example = " ".join(paragraph.split()).partition("Example: ")
        paragraphs += [escape(words)] if words else []
        paragraphs += [f"```sh\n{example}\n```"] if example else []
    return "\n\n".join(paragraphs)


def examples() -> str:
    """Write the page of example campaigns: the question and the expected answer of each, and the file."""
    parts = ["# Example campaigns", "The files in `campaigns/`, each with its question and the expected answer."]
    for file in sorted((ROOT / "campaigns").glob("*.toml")):
        text = file.read_text(encoding="utf-8")
        comments = re.match(r"(#.*\n)+", text)
        head = comments[0] if comments else ""
        prose = re.sub(r"^# ?", "", head, flags=re.MULTILINE).strip()
        prose = escape(prose).replace("\n\n", "\n").replace("Expected answer", "\n**Expected answer**")
        prose = prose.replace("Question:", "**Question:**")
        code = text[len(head) :].strip()
        anchor = file.stem.replace("_", "-")
        parts += [f"({anchor})=\n## {file.stem}", prose, f"```toml\n{code}\n```"]
    return "\n\n".join(parts) + "\n"
