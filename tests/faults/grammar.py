"""Campaign files of type ins and trajectory files by a grammar: valid, nearly valid, and hostile ones."""

from __future__ import annotations

import io
import json
import math
import random
from collections.abc import Callable
from copy import deepcopy
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

Tree = dict[str, Any]

AXES: Final = ("x", "y", "z")
DIRECTIONS: Final = ("north", "east", "down")

HOSTILE: Final[tuple[Any, ...]] = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, -0.0, 0, -1, 10**18, True, "", " ", "nan m", "inf s",
    "1e999 m",
    "-1e308 deg/h", "0 s", "-5 m", "5 furlong", "5 m/m/m", "5 m^9999999999", "m" * 500, "٣ m", "５ m", "1_0 m",
    "5\u00a0m",
    "\u202e5 m", "\U0001f680", "\x7f", "../../etc/passwd", "/dev/zero", "/dev/stdin", "CON", "a\nb",
    "=cmd|' /C calc'!A0",
    "${HOME}", "{{7*7}}", "<script>alert(1)</script>", "%s%n", "5 m; import os", "__class__", "1e5000000 m", "9" * 400,
    [], {}, [[]], [{}], [[[[[[]]]]]], ["5 m", 5, None], {"x": "5 m", "w": "5 m"}, {"": "5 m"}, ["5 m"] * 50,
    [math.nan] * 3, {"distribution": "fixed", "value": "5 m"}, {"distribution": "scipy.levy_stable"},
    {"distribution": "table", "file": "/dev/zero.csv", "column": "a", "unit": "m"},
)  # fmt: skip
"""What is put in place of a value."""

NAMES: Final = (
    "", "type", "name", "gate", "X" * 3_000, "a.b", "\u202e", "\U0001f680", "__proto__", "believes", "x", "9", " ",
    "bias", "imu", "é", "e\u0301", "gyro", "\t", "'", '"', "samples",
)  # fmt: skip
"""Keys that are put into tables."""


def maybe(chance: random.Random, probability: float = 0.5) -> bool:
    """Decide by chance."""
    return chance.random() < probability


def size(chance: random.Random, low: float, high: float, unit: str) -> str:
    """A quantity between two sizes, on the scale of the logarithm."""
    return f"{math.exp(chance.uniform(math.log(low), math.log(high))):.4g} {unit}"


def by_axis(chance: random.Random, axes: tuple[str, ...], value: Callable[[], str]) -> Any:
    """A value for all axes, a list, or a table of some."""
    kind = chance.randrange(4)
    if kind == 2:
        return [value() for _ in axes]
    if kind == 3:
        return {axis: value() for axis in axes if maybe(chance)} or value()
    return value()


def instrument(chance: random.Random, name: str) -> Tree:
    """``[imu.gyro]`` or ``[imu.accelerometer]``."""
    gyro = name == "gyro"
    bias, walk = ("deg/h", "deg/sqrt(h)") if gyro else ("ug", "ug/sqrt(Hz)")
    correlated = {"sigma": size(chance, 1e-3, 1, bias), "correlation_time": size(chance, 10, 1e4, "s")}
    cross = ("xy", "xz", "yx", "yz", "zx", "zy")
    whole: Tree = {
        "bias": by_axis(chance, AXES, lambda: size(chance, 1e-3, 10, bias)),
        "scale_factor": by_axis(chance, AXES, lambda: size(chance, 1, 1e3, "ppm")),
        "misalignment": by_axis(chance, cross, lambda: size(chance, 1, 100, "arcsec")),
        ("angle_random_walk" if gyro else "velocity_random_walk"): size(chance, 1e-3, 1, walk),
        "bias_instability": correlated,
        "rate_random_walk": size(chance, 1e-3, 1, "deg/h/sqrt(h)" if gyro else "ug/sqrt(s)"),
        "quantization": size(chance, 1e-7, 1e-5, "rad" if gyro else "m/s"),
    }
    return {key: value for key, value in whole.items() if maybe(chance, 0.4)}


def sensor(chance: random.Random, kind: str, name: str) -> Tree:
    """One table of ``[[aiding]]``."""
    found: Tree = {"type": kind}
    if maybe(chance):
        found["name"] = name
    if maybe(chance, 0.7):
        found["interval"] = size(chance, 1, 30, "s")
        if maybe(chance, 0.3):
            found["outages"] = [["20 s", "40 s"]]
        if maybe(chance, 0.2):
            found |= {"begin": "5 s", "end": "50 s"}
    else:
        found["instants"] = [f"{second} s" for second in sorted(chance.sample(range(1, 60), 3))]
    if maybe(chance, 0.2):
        found |= {"delay": size(chance, 1, 100, "ms"), "jitter": size(chance, 1, 10, "ms")}
    if maybe(chance, 0.2):
        found["gate"] = chance.choice([0.9, 0.99, 0.999999])
    correlated = {"sigma": size(chance, 1e-3, 10, "m"), "correlation_time": "100 s"}
    if kind == "gnss":
        found["position"] = by_axis(chance, DIRECTIONS, lambda: size(chance, 0.1, 10, "m"))
        if maybe(chance):
            found["velocity"] = size(chance, 0.01, 1, "m/s")
        if maybe(chance, 0.3):
            found |= {"lever_arm": ["1 m", "0 m", "-0.5 m"], "lever_arm_error": "2 cm"}
        if maybe(chance, 0.3) and isinstance(found["position"], str):
            found["position_correlated"] = correlated
    elif kind == "altimeter":
        found |= {"altitude": "2 m"}
        if maybe(chance):
            found |= {"bias": "20 m", "scale_factor": "0.1 %"}
        if maybe(chance, 0.2):
            found |= {"kind": "radar", "ceiling": "2 km"}
    else:
        quantity, unit = {
            "star-tracker": ("attitude", "arcsec"), "position-fix": ("position", "m"), "velocity": ("velocity", "m/s"),
            "heading": ("heading", "mrad"),
        }[kind]  # fmt: skip
        found[quantity] = size(chance, 1, 100, unit)
        if maybe(chance):
            found["bias"] = size(chance, 1, 100, unit)
    return found


def trajectory(chance: random.Random) -> Any:
    """``scenario.trajectory``: segments, a boost, or a file."""
    kind = chance.randrange(12)
    if kind < 3:
        return chance.choice(["flight.csv", {"file": "flight.csv"}, "flight.parquet"])
    if kind == 3 and maybe(chance, 0.1):  # which takes a second
        stages = [{"acceleration": "1.3 g", "last": "3 g", "burn": "60 s"}]
        return {"boost": {"latitude": "28 deg", "longitude": "-80 deg", "azimuth": "90 deg", "stages": stages}}
    start = {"latitude": size(chance, 1, 80, "deg"), "longitude": "9 deg", "altitude": "500 m", "course": "80 deg",
             "speed": size(chance, 10, 200, "m/s")}  # fmt: skip
    pieces = [{"hold": "20 s"}, {"speed": "90 m/s"}, {"climb": "100 m"}, {"turn": "45 deg"}, {"straight": "2 km"},
              {"turn": "-20 deg", "rate": "3 deg/s"}]  # fmt: skip
    return {"rate": "1 Hz", "start": start, "segments": [{"straight": "60 s"}, *chance.choices(pieces, k=2)]}


def believes(chance: random.Random, sensors: list[Tree]) -> Tree:
    """``[filter.believes]``."""
    found: Tree = {}
    if maybe(chance):
        found["imu"] = {"gyro": {"bias": "0.02 deg/h"}}
    if maybe(chance):
        found["errors"] = {chance.choice(["heading", "tilt", "position_north"]): "1 mrad"}
        found["errors"] = {key: "10 m" if key.startswith("position") else each for key, each in found["errors"].items()}
    if maybe(chance) and sensors[0]["type"] == "gnss":
        found["aiding"] = {sensors[0].get("name", "gnss"): {"position": "5 m"}}
    return found


def requirement(chance: random.Random) -> Tree:
    """``[[accept.r95]]``, in time or at the end."""
    found: Tree = {"outputs": ["position_north", "position_east"], "below": size(chance, 1, 1e3, "m")}
    when: list[Tree] = [{}, {}, {"after": "30 s"}, {"during": ["10 s", "40 s"]}]
    return found | chance.choice(when)


def campaign(chance: random.Random) -> Tree:
    """A valid campaign."""
    found: Tree = {"name": "by the grammar", "samples": chance.randrange(2, 5_000), "seed": chance.randrange(10**6)}
    if maybe(chance, 0.3):
        found["tolerance"] = "20 %"
    found["scenario"] = {"type": "ins", "trajectory": trajectory(chance)}
    if maybe(chance, 0.3):
        found["scenario"]["platform"] = chance.choice(["strapdown", "inertial", "level"])
    if maybe(chance, 0.2):
        found["scenario"]["end"] = "55 s"
    if maybe(chance, 0.2):
        found["imu"] = {"grade": "navigation"}
    elif maybe(chance, 0.9):
        found["imu"] = {name: instrument(chance, name) for name in ("gyro", "accelerometer") if maybe(chance, 0.8)}
    found["errors"] = {"position": "5 m"} | {
        key: value for key, value in (
            ("velocity", "0.1 m/s"), ("tilt", "0.1 mrad"), ("heading", "1 mrad"),
        ) if maybe(chance)
    }  # fmt: skip
    if maybe(chance, 0.7):
        kinds = ["gnss", "altimeter", "star-tracker", "position-fix", "velocity", "heading"]
        picked = chance.sample(kinds, chance.choice([1, 1, 2, 3]))
        found["aiding"] = [sensor(chance, kind, f"sensor_{number}") for number, kind in enumerate(picked)]
        found["filter"] = {"estimates": ["position", "velocity", "attitude"]}
        found["filter"]["estimates"] += [kind for kind in ("gyro_bias", "accelerometer_bias") if maybe(chance)]
        if maybe(chance, 0.2):
            found["filter"]["considers"] = ["gyro_scale_factor"]
        if maybe(chance, 0.2):
            found["filter"]["gate"] = 0.999
        if maybe(chance, 0.3):
            found["filter"]["believes"] = believes(chance, found["aiding"])
    if maybe(chance, 0.4):
        found["accept"] = {"r95": [requirement(chance) for _ in range(chance.choice([1, 2]))]}
    return found


def tables(tree: Any) -> list[Any]:
    """All tables and lists of a tree."""
    inner = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return [each for child in inner for each in tables(child)] + ([tree] if isinstance(tree, (dict, list)) else [])


def spoil(chance: random.Random, tree: Tree) -> None:
    """Change one thing somewhere."""
    place = chance.choice([each for each in tables(tree) if each] or [tree])
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    key, kind = chance.choice(keys), chance.randrange(7)
    if kind < 3:
        place[key] = deepcopy(chance.choice(HOSTILE))
    elif kind == 3:
        del place[key]
    elif kind == 4:
        other = chance.choice(tables(tree))
        place[key] = json.loads(json.dumps(other)) if len(json.dumps(other)) < 20_000 else 3
    elif kind == 5 and isinstance(place, dict):
        place[chance.choice(NAMES)] = deepcopy(chance.choice(HOSTILE))
    elif isinstance(place, list):
        place.extend([place[key]] * chance.choice([1, 2, 100]))
    else:
        renamed = f"{key}{chance.choice(['s', '_', ' ', 'x'])}"
        place[renamed] = place.pop(key)


def toml(value: Any) -> str:
    """Write a value inline; what TOML has no form for is written as text."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_text(str(key))} = {toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return _text(str(value))


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def written(tree: Tree) -> str:
    """Write a campaign file, one line for each key."""
    return "".join(f"{_text(str(key))} = {toml(value)}\n" for key, value in tree.items())


BOMBS: Final = 8


def bomb(kind: int, tree: Tree) -> str:
    """Write a campaign file with something large in it, of one of `BOMBS` kinds."""
    if kind == 0:
        return written(tree) + "x = " + "[" * 5_000 + "]" * 5_000 + "\n"
    if kind == 1:
        return written(tree) + "x = " + "{a = " * 2_000 + "1" + "}" * 2_000 + "\n"
    if kind == 2:
        return written(tree) + f'"{"k" * 10_000_000}" = 1\n'
    if kind == 3:
        return written(tree) + ".".join("a" * 1_000) + " = 1\n"
    if kind == 4:
        return written(tree | {"aiding": [{"type": "gnss", "interval": "1e-9 s", "position": "1 m"}]})
    if kind == 5:
        return written(tree | {"aiding": [{"type": "gnss", "instants": [f"{k} s" for k in range(60_000)]}]})
    if kind == 6:
        return written(tree | {"imu": {"gyro": {f"k{k}": "1 m" for k in range(20_000)}}})
    rows = {"rate": "10000 Hz", "start": {"latitude": "4 deg", "longitude": "9 deg", "speed": "1 m/s"}}
    return written(tree | {"scenario": {"type": "ins", "trajectory": rows | {"segments": [{"hold": "1e9 s"}] * 1_000}}})


def campaign_file(chance: random.Random) -> tuple[str, bytes]:
    """A kind, ``valid``, ``nearly``, ``hostile`` or ``bomb``, and the bytes of a file."""
    tree, kind = campaign(chance), chance.random()
    if kind < 0.15:
        return "valid", written(tree).encode()
    if kind < 0.6:
        spoil(chance, tree)
        return "nearly", written(tree).encode("utf-8", "surrogatepass")
    if kind < 0.998:
        for _ in range(chance.choice([2, 3, 6, 12])):
            spoil(chance, tree)
        return "hostile", written(tree).encode("utf-8", "surrogatepass")
    return "bomb", bomb(chance.randrange(BOMBS), tree).encode()


COLUMNS: Final = ("time", "lat", "lon", "alt", "VN", "VE", "VD", "roll", "pitch", "heading")
CELLS: Final = (
    "", "nan", "NaN", "inf", "-inf", "1e308", "-1e308", "1e999", "5e-324", "0x10", "1_000", "٣", "５", "1,5", "1;5",
    "abc", "=cmd|' /C calc'!A0", "@SUM(1+1)", "+1", "-", "1e", "--1", '"1"', '"', "'1'", "\x00", "\ufeff1", "\u202e1",
    "null", "N/A", "#REF!", "1 2", "9" * 500, "90", "-90", "360.5", "1e9", "x" * 100_000, "\U0001f680", "1.0.0", "TRUE",
)  # fmt: skip
"""What is put in place of a number of a trajectory file."""


UNITS: Final = ("rad", "deg", "m", "ft", "s", "kg", "", "[", "m/s")
"""Units in a header, right and wrong."""


def flight(chance: random.Random, count: int, rate: float) -> dict[str, list[float]]:
    """Rows of straight and level flight at constant speed to the north-east."""
    begin, latitude, speed = chance.choice([0.0, 1e5]), chance.uniform(-70.0, 70.0), chance.uniform(0.0, 250.0)
    time = [begin + k / rate for k in range(count)]
    north = east = math.sqrt(0.5) * speed
    radius = 6_378_137.0
    lat = [latitude + math.degrees(north * (t - begin) / radius) for t in time]
    lon = [9.0 + math.degrees(east * (t - begin) / radius / math.cos(math.radians(latitude))) for t in time]
    steady = {"alt": 500.0, "VN": north, "VE": east, "VD": 0.0, "roll": 0.0, "pitch": 0.0, "heading": 45.0}
    return {"time": time, "lat": lat, "lon": lon} | {name: [value] * count for name, value in steady.items()}


def trajectory_file(chance: random.Random) -> tuple[str, bytes]:
    """A kind and the bytes of a trajectory file, CSV or parquet."""
    count, rate = chance.choice([4, 5, 12, 30]), chance.choice([0.1, 1.0, 10.0])
    rows, kind = flight(chance, count, rate), chance.random()
    if maybe(chance, 0.3):
        for name in ("VN", "VE", "VD"):
            del rows[name]
    if kind < 0.15:
        return "valid", csv_of(rows, chance.choice([",", ";", "\t"]))
    if kind < 0.25:
        return "valid", parquet_of(pa.table(rows))
    if kind < 0.7:
        return "csv", _spoilt_csv(chance, rows)
    return "parquet", _spoilt_parquet(chance, rows)


def csv_of(rows: dict[str, list[float]], delimiter: str) -> bytes:
    lines = [delimiter.join(rows), *(delimiter.join(map(repr, line)) for line in zip(*rows.values(), strict=True))]
    return ("\n".join(lines) + "\n").encode()


def _spoilt_csv(chance: random.Random, rows: dict[str, list[float]]) -> bytes:
    delimiter = chance.choice([",", ";", "\t", " ", "|"]) if maybe(chance, 0.1) else ","
    lines = [line.split(delimiter) for line in csv_of(rows, delimiter).decode().splitlines()]
    for _ in range(chance.choice([1, 1, 2, 5])):
        kind, line = chance.randrange(11), chance.randrange(len(lines))
        column = chance.randrange(max(len(lines[line]), 1))
        if kind < 3 and lines[line]:
            lines[line][column] = chance.choice(CELLS)
        elif kind == 3:
            lines[line].append(chance.choice(CELLS))
        elif kind == 4 and lines[line]:
            del lines[line][column]
        elif kind == 5:
            lines[line], lines[-1] = lines[-1], lines[line]  # time going back
        elif kind == 6:
            lines.insert(line, list(lines[line]))
        elif kind == 7:
            lines[0] = [f"{name} [{chance.choice(UNITS)}]" for name in lines[0]]
        elif kind == 8:
            lines[0] = chance.sample(lines[0], len(lines[0]))
        elif kind == 9:
            del lines[line:]
            lines.append([])
        else:
            lines[0] = lines[0] * 2 if maybe(chance) else [name.upper() for name in lines[0]]
    text = chance.choice(["\n", "\n", "\r\n", "\r"]).join(delimiter.join(line) for line in lines)
    content = text.encode("utf-8", "surrogatepass")
    if maybe(chance, 0.15):
        begins = [b"\xef\xbb\xbf", b"\xff\xfe", b"\x00", b"# a remark\n", b"\n\n", b"PAR1", b"\xff"]
        content = chance.choice(begins) + content
    if maybe(chance, 0.1):
        place = chance.randrange(len(content) + 1)
        content = content[:place] + bytes([chance.randrange(256)]) + content[place + chance.randrange(3) :]
    return content


def parquet_of(table: pa.Table, **options: Any) -> bytes:
    sink = io.BytesIO()
    pq.write_table(table, sink, **options)
    return sink.getvalue()


def _spoilt_parquet(chance: random.Random, rows: dict[str, list[float]]) -> bytes:
    columns: dict[str, Any] = {name: pa.array(values) for name, values in rows.items()}
    name, kind = chance.choice(list(columns)), chance.randrange(13)
    count = len(columns[name])
    others: list[Callable[[], Any]] = [
        lambda: pa.array([chance.choice(CELLS).replace("\x00", "") for _ in range(count)]),
        lambda: pa.array([None] * count),
        lambda: pa.array([None if k == 1 else 1.0 for k in range(count)]),
        lambda: pa.array([[1.0]] * count),
        lambda: pa.array([{"a": 1.0}] * count),
        lambda: pa.array([True] * count),
        lambda: pa.array(rows[name], type=pa.float32()),
        lambda: pa.array([b"1"] * count),
        lambda: pa.array([10**15 + k for k in range(count)], type=pa.timestamp("us")),
        lambda: pa.array(["1.0"] * count).dictionary_encode(),
        lambda: pa.array([chance.choice([math.nan, math.inf, 1e308, -1e308]) for _ in range(count)]),
    ]
    if kind < 11:
        columns[name] = others[kind]()
        content = parquet_of(pa.table(columns))
    elif kind == 11:  # a million rows or more of one number take a few kilobytes
        many = chance.choice([1_000_000, 6_000_000])
        same = pa.DictionaryArray.from_arrays(pa.array(np.zeros(many, dtype=np.int32)), pa.array([1.0]))
        content = parquet_of(pa.table(dict.fromkeys(columns, same)), compression="zstd")
    else:
        content = parquet_of(pa.table(columns | {f"c{k}": columns[name] for k in range(chance.choice([1, 2_000]))}))
    if maybe(chance, 0.4):
        spoilt = bytearray(content)
        for _ in range(chance.choice([1, 2, 8])):
            spoilt[chance.randrange(4, len(spoilt))] = chance.randrange(256)
        content = bytes(spoilt)
    return content[: chance.randrange(len(content))] if maybe(chance, 0.1) else content
