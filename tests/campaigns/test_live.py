"""`mcnav live`: what its server refuses, what it answers, and how it ends."""

from __future__ import annotations

import http.client
import json
import os
import re
import shutil
import signal
import socket
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Thread, Timer
from typing import Any

import pytest

from mcnav.cli.printing import opened_in_secret
from mcnav.errors import CampaignError
from mcnav.execution import interrupts
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.live import MOST, LiveCampaign
from mcnav.studies.live_server import LARGEST, LiveServer, answer_requests
from tests.commands import invoke
from tests.conftest import ROOT
from tests.runs import vary

TURNS = set(map(chr, (0x61C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))))
"""Bidirectional control characters (Unicode, property Bidi_Control)."""

CRUISE = ROOT / "campaigns" / "11_cruise.toml"

FILTERED = """
name = "a filter"
samples = 200
seed = 1

[scenario]
type = "ins"
trajectory = "flight.csv"
start = "300 s"
end = "400 s"

[imu]
grade = "tactical"

[errors]
position = "10 m"
velocity = "0.1 m/s"
tilt = "0.5 mrad"
heading = "3 mrad"

[[aiding]]
type = "gnss"
interval = "10 s"
position = "3 m"

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]

[[accept.r95]]
outputs = ["position_north", "position_east"]
below = "10 m"
"""
"""An aided navigation whose filter believes the truth, with a requirement."""

CURVED = """
import numpy as np
from mcnav import Output, Source


class Curved:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"),)

    def propagate(self, errors):
        return np.sqrt(np.abs(errors))
"""
"""A scenario without a linear model."""


@pytest.fixture
def filtered(tmp_path: Path) -> Path:
    """Return the file of an aided navigation."""
    shutil.copy(ROOT / "campaigns" / "flight.csv", tmp_path)
    (tmp_path / "filtered.toml").write_text(FILTERED, encoding="utf-8")
    return tmp_path / "filtered.toml"


@contextmanager
def served(live: LiveCampaign) -> Iterator[LiveServer]:
    """Answer requests in another thread."""
    server = LiveServer()
    thread = Thread(target=answer_requests, args=(live, server))
    thread.start()
    try:
        yield server
    finally:
        server.end()
        thread.join()


def ask(server: LiveServer, path: str, content: Any = None, **headers: str) -> tuple[int, str]:
    """Send a request to a server, a posted one with some content; return its status and the text."""
    connection = http.client.HTTPConnection(*server.server_address)
    method = "GET" if content is None else "POST"
    text = content if content is None or isinstance(content, str) else json.dumps(content)
    given = {"Content-Type": "application/json"} if content is not None else {}
    connection.request(method, path, text, given | {name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    body = answer.read().decode()
    assert answer.headers["Cache-Control"] == "no-store"
    connection.close()
    return answer.status, body


def test_requests_that_are_refused(tmp_path: Path) -> None:
    """Without the token, to another host, from another page; and there is nothing but the page."""
    with served(LiveCampaign(CRUISE, tmp_path, 1)) as server:
        own, host = f"/{server.token}/", f"127.0.0.1:{server.server_port}"
        assert server.server_address[0] == "127.0.0.1"
        assert len(server.token) >= 32
        assert ask(server, own)[0] == 200
        assert ask(server, own, Host=f"localhost:{server.server_port}", Origin=f"http://{host}")[0] == 200
        for path in ("/", "//", "/state", f"/{server.token[:-1]}/", f"/{server.token[:-1]}x/state", "/%C3%A9/"):
            assert ask(server, path) == (403, "403: this is not the address that mcnav live has printed; its token is "
                                              "missing or wrong")  # fmt: skip
        assert ask(server, "/tune", {"revision": 1, "factors": {}})[0] == 403
        assert ask(server, own, Host=f"evil.example:{server.server_port}")[0] == 403
        assert ask(server, own + "stop", {}, Origin="http://evil.example")[0] == 403
        for path in ("../../etc/passwd", "..%2f..%2fetc/passwd", "11_cruise.toml", "setting/", "setting/-1", "tune"):
            assert ask(server, own + path)[0] == 404
        assert ask(server, own + "tune", {"revision": 1, "factors": {}}, Content_Type="text/plain")[0] == 404
        assert ask(server, own + "run", {})[0] == 404
        assert ask(server, own + "tune", " " * (LARGEST + 1))[0] == 413
        assert ask(server, own + "tune", Content_Length="-1", content={})[0] == 400
        for number in ("1" * 5_000, "1" * 19):
            assert ask(server, own + f"setting/{number}") == (400, "400: the number has more than 18 digits")
        for wrong in (
            "{",
            "[]",
            {},
            {"revision": "x", "factors": {}},
            {"revision": 1, "factors": [1]},
            "[" * 50_000,
            '{"revision": 1e999, "factors": {}}',
            '{"revision": 1, "factors": {"a": 1e999}}',
            '{"revision": 1, "factors": {"a": NaN}}',
            f'{{"revision": 1, "factors": {{"a": 1{"0" * 400}}}}}',
            f'{{"revision": {"1" * 5_000}, "factors": {{}}}}',
        ):
            assert ask(server, own + "tune", wrong)[0] == 400
        assert ask(server, own + "setting/99") == (409, f"setting 99: is not among the last {MOST}")
        assert ask(server, own + "report/1") == (409, "setting 1: has no finished run")
        assert ask(server, own)[1].count("connect-src") == 1


def test_settings_are_tuned_anew(filtered: Path, tmp_path: Path) -> None:
    """What is kept is the linear answer to the campaign with that number, whose filter believes it."""
    live = LiveCampaign(filtered, tmp_path / "runs", 1)
    live.tune(1, {"aiding.gnss.position": 3.0, "errors.heading": 1.0})
    expected = answer_linearly(vary(filtered, {"aiding.gnss.position": "9 m"}))
    assert expected.history is not None
    assert expected.history.sigma_filter is not None
    campaign, setting = live.state()["settings"]  # type: ignore[misc]
    assert setting["changed"] == [("aiding.gnss.position", "9 m")]
    north = setting["sigmas"][0]
    assert north["shown"] == f"{expected.sigma[0]:.3f}"
    assert north["claimed"] == f"{expected.history.sigma_filter[-1, 0]:.3f}" != campaign["sigmas"][0]["claimed"]
    assert [campaign["requirements"][0]["finding"], setting["requirements"][0]["finding"]] == ["met", "not met"]
    copied = tomllib.loads(live.campaign_file(setting["number"]))
    assert copied["aiding"][0]["position"] == "9 m"
    assert "believes" not in copied["filter"]
    assert "not modelled" in live.setting_page(setting["number"]).lower()
    for factors, key in (({"imu.gyro.colour": 2.0}, "imu.gyro.colour"), ({"errors.heading": float("nan")}, "heading")):
        with pytest.raises(CampaignError, match=key):
            live.tune(1, factors)
    live._tried += [replace(live._tried[1]) for _ in range(MOST)]  # many, without their time
    live.tune(1, {"errors.heading": 2.0})
    numbers = [each["number"] for each in live.state()["settings"]]  # type: ignore[attr-defined]
    assert numbers == [1, *[2] * (MOST - 1), 3]


def test_the_file_is_followed(filtered: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mistake is one line, and the last answer stays; settings of an earlier content are kept and not continued."""
    live = LiveCampaign(filtered, tmp_path / "runs", 1)
    live.tune(1, {"errors.heading": 2.0})
    before = live.state()
    live.watch()
    assert live.state() == before
    filtered.write_text(
        FILTERED.replace('position = "10 m', 'position = "10 kg').replace("0.1 m/s", "0.1 m"), encoding="utf-8"
    )
    live.watch()
    broken = live.state()
    assert re.fullmatch(rf"{filtered}: errors\.position: .*\(and 1 more\)", str(broken["error"]))
    assert broken["settings"] == before["settings"]
    filtered.unlink()
    live.watch()
    assert "no such file" in str(live.state()["error"])
    filtered.write_text(FILTERED.replace('below = "10 m"', 'below = "9.5 m"'), encoding="utf-8")
    live.watch()
    mended: Any = live.state()
    assert (mended["error"], mended["revision"]) == ("", 2)
    assert [each["revision"] for each in mended["settings"]] == [2, 1]
    with pytest.raises(CampaignError, match="has changed in the meantime"):
        live.tune(1, {"errors.heading": 2.0})
    os.utime(tmp_path / "flight.csv", ns=(1, 1))
    live.watch()
    assert live.state()["revision"] == 3  # a file that the campaign names

    def meanwhile() -> None:
        """Read half a file, whose other half is written before the watch ends."""
        monkeypatch.undo()
        try:
            live._answer()
        finally:
            filtered.write_text(FILTERED, encoding="utf-8")

    filtered.write_text(FILTERED[: len(FILTERED) // 8], encoding="utf-8")
    monkeypatch.setattr(live, "_answer", meanwhile)
    live.watch()
    assert (live.state()["error"], live.state()["revision"]) == ("", 4)


def test_usual_mistakes(tmp_path: Path) -> None:
    """One line each, and nothing listens afterwards."""
    (tmp_path / "curved.py").write_text(CURVED, encoding="utf-8")
    (tmp_path / "curved.toml").write_text(
        "name = 'c'\nsamples = 100\nseed = 1\n[scenario]\ntype = 'curved.py:Curved'\n[errors]\na = '1 m'\n"
    )
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        for words, expected in (
            (["11_cruse.toml"], r"11_cruse\.toml: no such file; .*"),
            ([ROOT / "README.md"], r".*README\.md: is not TOML: .*"),
            (["curved.toml"], r"curved\.toml: scenario: .*"),
            ([CRUISE, "--port", port], rf"--port: got {port}: Address already in use; leave the option out, and .*"),
            ([CRUISE, "--out", "runs.html"], r"--out: got runs\.html; expected a folder, such as runs"),
        ):
            done = invoke("live", *words, cwd=tmp_path)
            assert (done.returncode, done.stdout) == (2, "")
            assert re.fullmatch(rf"error: {expected}\n", done.stderr), done.stderr


@pytest.mark.posix
def test_an_interrupt_is_its_ordinary_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command says what is next, and prints no error; a termination ends it as others."""

    def interrupted(*content: Any) -> None:
        Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
        answer_requests(*content)

    monkeypatch.setattr("mcnav.studies.live_server.answer_requests", interrupted)
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, interrupts._interrupt)
        done = invoke("live", CRUISE, cwd=tmp_path)
        assert re.fullmatch(rf"page: http://127\.0\.0\.1:\d+/\S{{32}}/\nCtrl-C ends it\n\nnext: mcnav run {CRUISE}\n",
                            done.stdout)  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        with interrupts.until_interrupted():
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt), interrupts.until_interrupted():
            signal.raise_signal(signal.SIGTERM)
    finally:
        interrupts.interrupts.received.clear()
        signal.signal(signal.SIGINT, before[0])
        signal.signal(signal.SIGTERM, before[1])


def test_the_token_is_not_on_the_browser_s_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is in a file that only its user can read, and that goes with the command."""
    shown: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: bool(shown.append(address)) or True)
    with opened_in_secret("http://127.0.0.1:1/token/", tmp_path / "runs"):
        (page,) = (tmp_path / "runs").iterdir()
        assert shown == [page.resolve().as_uri()]
        assert "url=http://127.0.0.1:1/token/" in page.read_text()
        assert page.stat().st_mode & 0o777 == 0o600
    assert not page.exists()


def test_text_that_turns_is_shown_as_its_codes(tmp_path: Path) -> None:
    """In the page and in its state: such a name could read as another."""
    turned = tmp_path / "turned.toml"
    named = re.sub(r'(?m)^name = ".*"', r'name = "a\\u202eb\\u2066c\\u200fd"', CRUISE.read_text(encoding="utf-8"))
    turned.write_text(named, encoding="utf-8")
    with served(LiveCampaign(turned, tmp_path, 1)) as server:
        for path in ("", "state"):
            text = ask(server, f"/{server.token}/{path}")[1]
            assert not set(text) & TURNS
            assert path or "a[U+202E]b[U+2066]c[U+200F]d" in text
