"""Completions of the command line: files, names and keys that fit where the cursor is.

A shell starts the program for each, so that this module imports no numerical library, but for the names of outputs: it
looks into files for the few words that it needs.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final, Protocol

MOST_FILES: Final = 2_000
"""Files and folders that are looked at."""

DEEPEST: Final = 3
"""Folders below the one named so far that are looked into."""

BEGINNING: Final = 65_536
"""Bytes of a file in which a table of a campaign is looked for."""

LARGEST: Final = 1_000_000
"""Bytes of the largest file that is read as a whole."""

SCENARIO: Final = re.compile(rb"^\s*(\[\s*scenario\b|scenario\s*[.=])", re.MULTILINE)
FIGURE: Final = re.compile(r'<figure id="figure-([a-z_]+)">')

SENSOR: Final = re.compile(r'^SENSOR\b.*= SensorType\(\s*name="([a-z0-9-]+)"', re.MULTILINE)
"""Definition of a type of sensor."""

ENGINES: Final = re.compile(r"^ +(?:self\.)?engines = .*$|^    def engines\(.*\n(?: {8}.*\n)+", re.MULTILINE)
"""Definition of the engines of a scenario: an attribute, or a property."""

TUPLE: Final = re.compile(r'\(((?:"[a-z-]+",? ?)+)\)')
"""Tuple of names."""

MAP: Final = "map"
"""Engine that every scenario without noise and filter has besides its own."""

HORIZONTAL: Final = ("position_horizontal", "velocity_horizontal")
"""Horizontal errors that a sweep measures where a scenario has both axes."""

Content = dict[str, Any]
"""Content of a TOML table, or parameters of a command."""


class Words(Protocol):
    """The words before the cursor, read as parameters of the command; the others where an option has no value yet."""

    params: Content
    args: list[str]


def campaigns(incomplete: str) -> list[str]:
    """Return campaign files whose path begins with the incomplete one."""
    return _quoted(path for path in _walk(incomplete, ".toml") if _is_campaign(Path(path)))


def trajectories(incomplete: str) -> list[str]:
    """Return files that may be trajectories."""
    result = _walk(incomplete, (".csv", ".parquet", ".txt", ".pos", ".nmea", ".gpx", ".ulg"))
    return _quoted(path for path in result if not Path(path).with_name("manifest.json").exists())


def logs(incomplete: str) -> list[str]:
    """Return files that may be records of sensors."""
    result = _walk(incomplete, (".csv", ".txt", ".parquet", ".mat", ".ulg", ".bag", ".db3", ".mcap"))
    return _quoted(path for path in result if not Path(path).with_name("manifest.json").exists())


def checkable(incomplete: str) -> list[str]:
    """Return campaign files, code, and files that may be trajectories."""
    return [*campaigns(incomplete), *trajectories(incomplete), *_quoted(_walk(incomplete, ".py"))]


def runs(incomplete: str) -> list[str]:
    """Return run folders: those with a manifest."""
    return _quoted(path.removesuffix("/manifest.json") for path in _walk(incomplete, "/manifest.json"))


def units(incomplete: str) -> list[str]:
    """Return grades and units of the catalogue of inertial measurement units."""
    return _quoted(_beginning([unit["name"] for unit in _catalogue()], incomplete))


def units_of_page(words: Words, incomplete: str) -> list[str]:
    """Return the grades and units of the page named before, where that is the catalogue."""
    return units(incomplete) if words.params.get("page") == "imu" else []


def aids(incomplete: str) -> list[str]:
    """Return types of sensors."""
    texts = (
        file.read_text(encoding="utf-8") for file in sorted(Path(__file__).parents[1].glob("systems/ins/sensors/*.py"))
    )
    return _beginning([name for text in texts for name in SENSOR.findall(text)], incomplete)


def engines(incomplete: str) -> list[str]:
    """Return the engines of all types of scenarios."""
    texts = (
        file.read_text(encoding="utf-8") for file in sorted(Path(__file__).parents[1].glob("systems/*/*scenario.py"))
    )
    listed = [names for text in texts for defined in ENGINES.findall(text) for names in TUPLE.findall(defined)]
    names = [name.strip('" ') for line in listed for name in line.split(",") if name]
    return _beginning(dict.fromkeys((*names, MAP)), incomplete)


def filter_kinds(incomplete: str) -> list[str]:
    """Return the kinds of filters."""
    from mcnav.systems.ins.filter.model import KINDS

    return _beginning(KINDS, incomplete)


def examples(incomplete: str) -> list[str]:
    """Return the example campaigns, which lie in the package or in the checkout."""
    package = Path(__file__).parents[1]
    folders = (package / "campaigns", package.parent / "campaigns")
    folder = next((folder for folder in folders if folder.is_dir()), None)
    return _beginning(sorted(path.stem for path in folder.glob("*.toml")) if folder else (), incomplete)


def figures(words: Words, incomplete: str) -> list[str]:
    """Return the figures of the report of the run named before."""
    folder = words.params.get("folder") or next((word for word in words.args if Path(word).is_dir()), None)
    text = _text(Path(folder) / "report.html", 100 * LARGEST) if folder else ""
    return _beginning(dict.fromkeys(FIGURE.findall(text)), incomplete)


def outputs(words: Words, incomplete: str) -> list[str]:
    """Return the outputs of the campaign named before; those of a user's class are not known without executing it."""
    from mcnav.systems.registry import SCENARIO_TYPES

    content = _campaign(words)
    scenario = content.get("scenario")
    kind = SCENARIO_TYPES.get(str(scenario.get("type"))) if isinstance(scenario, dict) else None
    names = [output.name for output in kind.outputs_in(content)] if kind is not None else []
    together = [name for name in HORIZONTAL if name.replace("horizontal", "north") in names]
    return _beginning([*names, *together], incomplete)


def keys(words: Words, incomplete: str) -> list[str]:
    """Return the paths of the values in the campaign named before, with those of the unit that it names.

    After them come those that words vary: the unit, outages, sensors, and states of the filter.
    """
    content = _campaign(words)
    imu = content.get("imu")
    grade = imu.get("grade") if isinstance(imu, dict) else None
    below = next((unit for unit in _catalogue() if unit["name"] == grade), {}) if grade else {}
    of_unit = {name: dict.fromkeys(below[name]) for name in ("gyro", "accelerometer") if name in below}
    result = [*_paths(content, ""), *_paths({"imu": of_unit}, ""), *_varied_by_words(content)]
    return _beginning(dict.fromkeys(result), incomplete)


def sources(words: Words, incomplete: str) -> list[str]:
    """Return the error sources that the campaign named before gives in ``[errors]``."""
    return _beginning(_campaign(words).get("errors", {}), incomplete)


def for_words(complete: Callable[[Words, str], list[str]]) -> Callable[[Any, list[str], str], list[str]]:
    """Return a completion with the parameters that typer calls it with."""

    def completed(ctx: Any, args: list[str], incomplete: str) -> list[str]:
        return complete(ctx, incomplete)

    return completed


def _beginning(names: Any, incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _walk(incomplete: str, ending: str | tuple[str, ...]) -> Iterator[str]:
    """Yield paths of files with an ending, as written so far; hidden folders and those of packages are left out."""
    above, _, begun = incomplete.rpartition("/")
    start = f"{above}/" if "/" in incomplete else ""
    left = [(start, DEEPEST)]
    seen = 0
    while left:
        folder, depth = left.pop(0)
        try:
            entries = sorted(os.scandir(folder or "."), key=lambda entry: entry.name)
        except OSError:
            continue
        for entry in entries:
            seen += 1
            if seen > MOST_FILES:
                return
            name = entry.name
            if folder == start and not name.startswith(begun):
                continue
            if name.startswith((".", "__")) and not (folder == start and begun):
                continue
            if entry.is_file() and f"/{name}".endswith(ending):
                yield folder + name
            elif depth > 0 and name not in ("node_modules", "samples", "inputs", "tables") and entry.is_dir():
                left.append((f"{folder}{name}/", depth - 1))


def _is_campaign(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return SCENARIO.search(file.read(BEGINNING)) is not None
    except OSError:
        return False


def _campaign(words: Words) -> Content:
    """Read the campaign file named before; nothing when it cannot be read."""
    named = (words.params.get("campaign"), *(word for word in words.args if word.endswith(".toml")))
    path = next((campaign for campaign in named if campaign), None)
    try:
        return tomllib.loads(_text(Path(path), LARGEST)) if path else {}
    except (tomllib.TOMLDecodeError, RecursionError):
        return {}


def _catalogue() -> list[Content]:
    text = files("mcnav").joinpath("systems/ins/tables/imu_catalogue.toml").read_text(encoding="utf-8")
    catalogue: list[Content] = tomllib.loads(text)["unit"]
    return catalogue


def _text(path: Path, largest: int) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace") if path.stat().st_size <= largest else ""
    except OSError:
        return ""


def _paths(table: Mapping[str, Any], above: str) -> Iterator[str]:
    """Yield the paths of values with a size; entries of lists have their name, or type, or number."""
    for key, value in table.items():
        path = f"{above}{key}"
        if isinstance(value, dict):
            yield from _paths(value, f"{path}.")
        elif isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            for number, entry in enumerate(value, start=1):
                yield from _paths(entry, f"{path}.{_sensor_name(entry, number)}.")
        elif not isinstance(value, (list, bool)) and key not in ("name", "type", "grade"):
            yield path


def _varied_by_words(content: Content) -> Iterator[str]:
    """Yield the paths that a sweep varies by words, or by the length and the begin of an outage."""
    if isinstance(content.get("imu"), dict) and "grade" in content["imu"]:
        yield "imu.grade"
    sensors, settings = content.get("aiding"), content.get("filter")
    for sensor in sensors if isinstance(sensors, list) else ():
        if isinstance(sensor, dict):
            path = f"aiding.{_sensor_name(sensor, '')}"
            yield path
            outages = sensor.get("outages")
            for number in range(1, (len(outages) if isinstance(outages, list) else 0) + 1):
                yield from (f"{path}.outages.{number}.{place}" for place in ("length", "begin"))
    for key in ("estimates", "considers"):
        states = settings.get(key) if isinstance(settings, dict) else None
        yield from (f"filter.{key}.{state}" for state in (states if isinstance(states, list) else ()))


def _sensor_name(entry: Mapping[str, Any], otherwise: object) -> str:
    return str(entry.get("name", str(entry.get("type", otherwise)).replace("-", "_")))


def _quoted(names: Any) -> list[str]:
    """Return names as a shell inserts them: bash takes a blank for the end of a word."""
    if os.environ.get("_MCNAV_COMPLETE") != "complete_bash":
        return list(names)
    return [re.sub(r"([\s'\"\\$`&|;<>()*?\[\]])", r"\\\1", name) for name in names]
