"""Commands for a few: published numbers, and what developers and images of machines need."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mcnav.cli import next_command
from mcnav.cli.options import out_folder
from mcnav.cli.output_place import output_file, output_folder
from mcnav.cli.printing import err, out, print_line, print_next, print_written, write_data
from mcnav.cli.program import command, dev, failure


@command(group=dev)
def schema(
    into: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write the schema into a folder, or a file ending in .json.")
    ] = None,
) -> None:
    """Print the JSON schema of campaign files, for editors.

    Editors complete, describe and check campaigns by it. A campaign names it in its first line: #:schema
    ./mcnav.schema.json

    Example: mcnav dev schema --out mcnav.schema.json
    """
    from mcnav.config.json_schema.files import SCHEMA_FILE, schema_text
    from mcnav.files.whole import write_texts

    if into is None:
        write_data(schema_text(), "json")
    else:
        file = output_file(into, SCHEMA_FILE, [".json"])
        print_written(write_texts(file.parent, {file.name: schema_text()}))
        print_next(next_command.written("docs", "campaigns"))


@command("compile", dev)
def compile_all(
    into: Annotated[
        Path | None,
        typer.Option("--out", "-o", "--into", metavar="FOLDER", help="Write compiled objects here, for a wheel."),
    ] = None,
    level: Annotated[
        Literal["x86-64-v3", "x86-64-v4"] | None,
        typer.Option(help="Processor level of the objects [default: the highest of this processor]."),
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Compile for this example only; repeat.")
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Parallel processes.")] = 2,
) -> None:
    """Compile all kernels beforehand, for images and clusters.

    No later command compiles then. Every example is run with a few samples, by each engine. A line says what is done.

    Example: mcnav dev compile
    """
    if level is not None and into is None:
        raise failure("--level: belongs to --out; add --out FOLDER")
    if into is not None:
        from mcnav.compiled.target import choose_objects

        try:
            choose_objects(into, level)
        except ValueError as wrong:
            raise failure(f"--level: {wrong}") from None
    from mcnav.entries.examples import example
    from mcnav.studies.precompile import compile_kernels

    names = [example(name).stem for name in only or ()]
    count = compile_kernels(names, jobs, lambda line: err.print(line, highlight=False, soft_wrap=True))
    out.print(f"{count} functions compiled, all others were stored")
    print_next(next_command.written("demo"))


@command()
def reproduce(
    document: Annotated[
        Literal["tn-d1772", "story-of-84-minutes", "textbook", "ukfm"],
        typer.Argument(
            metavar="DOCUMENT",
            help="tn-d1772 (NASA TN D-1772), story-of-84-minutes, textbook (closed forms), or ukfm (five filters).",
        ),
    ],
    folder: Annotated[Path | None, out_folder("reports/DOCUMENT")] = None,
    samples: Annotated[int | None, typer.Option(min=2, help="Of ukfm: runs of each filter [default: 10000].")] = None,
) -> None:
    """Recompute the numbers and figures of a publication.

    The results are a page and CSV files.

    Example: mcnav reproduce textbook --out recomputed
    """
    from collections import Counter

    from mcnav.validation.reproduce.story_of_84_minutes import page as story_page
    from mcnav.validation.reproduce.textbook import page as textbook_page
    from mcnav.validation.reproduce.tn_d1772 import page
    from mcnav.validation.reproduce.ukfm import page as ukfm_page

    if samples is not None and document != "ukfm":
        raise failure(f"--samples: belongs to ukfm; leave it out for {document}")
    target = output_folder(folder, Path("reports") / document)
    following = next_command.written("docs", "story" if document == "story-of-84-minutes" else document)
    if document == "story-of-84-minutes":
        print_written(story_page.write(target))
        print_next(following)
        return
    if document == "textbook":
        numbers, written = textbook_page.write(target)
        out.print(f"{len(numbers)} published numbers")
        for agreement, count in Counter(number.agreement for number in numbers).most_common():
            out.print(f"{count:6} {textbook_page.PHRASES[agreement]}")
        print_written(written)
        print_next(following)
        return
    if document == "ukfm":
        summary, written = ukfm_page.write(target, samples)
        out.print(summary)
        print_written(written)
        print_next(following)
        return
    cells, files = page.write_reproduction(target)
    out.print(f"{len(cells)} printed numbers")
    for mark, count in Counter(cell.mark for cell in cells).most_common():
        out.print(f"{count:6} {page.PHRASES[mark]}")
    print_line(f"\nwritten: {files[0]}\nand {len(files) - 1} tables in the same folder")
    print_next(following)
