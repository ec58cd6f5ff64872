"""The section "What if" against `mcnav lincov` of the campaign file that it copies.

The page adds numbers of single precision, each good to 6e-8, or of double precision where terms may cancel: 1e-6 of a
sigma. Requirements are compared with the values of linear analysis, whose circles and quantiles are good to 1e-9, and
whose boxes are to 1e-7 by another rule.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mcnav
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.physics.units import quantity
from mcnav.report.document.html import page_html
from mcnav.report.pages.lincov_page import page as lincov_page
from mcnav.statistics.normal_box import normal_box_probability
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.what_if import what_if_of_answer
from tests.browser.conftest import Browser
from tests.campaigns.test_what_if import AIDED, CAMPAIGNS
from tests.conftest import campaign

SETTINGS = 2
"""Random settings of all sliders, of each campaign."""

MOVE = """(factors) => {
  const sliders = Array.from(document.querySelectorAll(".what-if input[type=range]"));
  sliders.forEach((each, n) => { each.value = factors[n]; each.dispatchEvent(new Event("input")); });
  return sliders.length;
}"""

RESULTS = "document.querySelector('.what-if').results()"


def settings(page: Any, seed: int) -> list[dict[str, Any]]:
    """Move all sliders at random and return what the page has each time."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(SETTINGS):
        count = page.evaluate(MOVE, np.zeros(99).tolist())
        page.evaluate(MOVE, rng.uniform(-1.5, 1.5, count).tolist())
        found.append(page.evaluate(RESULTS))
    return found


def compare(page: Any, file: str, seed: int) -> None:
    """Compare sigmas and requirements with the linear answer to the copied file, and the answer with the first one.

    Of boxes of three sides the value is compared alone: the margin takes minutes by the rule of linear analysis.
    """
    before = page.evaluate(RESULTS)["sigmas"]
    for found in settings(page, seed):
        content = tomllib.loads(found["toml"])
        boxes = [each for each in content.get("accept", {}).get("box", []) if len(each["within"]) > 2]
        for box in boxes:
            content["accept"]["box"].remove(box)
        answer = answer_linearly(parse_campaign(content, file, "what if"))
        expected = np.concatenate([answer.history.sigma, answer.sigma[None]]) if answer.history else answer.sigma[None]
        sigmas = np.array(found["sigmas"])
        assert np.abs(sigmas - before).max() > 0.0
        np.testing.assert_allclose(sigmas, expected, rtol=1e-6, atol=1e-12 * float(expected.max()))
        judged = [each for each in answer.requirements if each.judged]
        assert len(judged) + len(boxes) == len(found["requirements"])
        for linear, (value, margin) in zip(judged, found["requirements"], strict=False):
            boxed = linear.requirement.kind == "box"
            assert value == pytest.approx(linear.value, rel=1e-6, abs=1e-6 if boxed else 0.0)
            assert margin == pytest.approx(linear.margin, rel=1e-5 if boxed else 2e-6)
        for box, (value, _) in zip(boxes, found["requirements"][len(judged) :], strict=True):
            names = [output.name for output in answer.outputs]
            picked = [names.index(name) for name in box["within"]]
            limits = [
                quantity(limit, answer.outputs[i].unit) for i, limit in zip(picked, box["within"].values(), strict=True)
            ]
            moments = answer.mean[picked], answer.covariance[np.ix_(picked, picked)]
            assert value == pytest.approx(normal_box_probability(*moments, np.array(limits)), abs=1e-6)


def written(content: dict[str, Any], file: str, folder: Path) -> Path:
    """Write the page of `mcnav lincov` on a campaign."""
    answer = answer_linearly(parse_campaign(content, file, "what if"))
    page = folder / "lincov.html"
    page.write_text(page_html(lincov_page(answer, {}, what_if_of_answer(answer, content, "here"))), encoding="utf-8")
    return page


def test_sigmas_of_an_aided_navigation_with_its_gains_held(browser: Browser, tmp_path: Path) -> None:
    """Beliefs of some axes, correlated errors, a requirement on a radius over time."""
    file = str(CAMPAIGNS / "aided.toml")
    with browser.opened(written(AIDED, file, tmp_path)) as page:
        compare(page, file, 1)
        assert "Filter gains held" in page.locator(".what-if .filter").inner_text()


def test_sigmas_without_a_filter(browser: Browser, tmp_path: Path) -> None:
    """A strapdown navigation with noise, in single precision."""
    file = str(CAMPAIGNS / "16_flight_tactical_grade.toml")
    content = tomllib.loads(Path(file).read_text(encoding="utf-8"))
    spheres = [{"outputs": ["position_north", "position_east", "position_down"], "below": "9 km", "after": "3000 s"}]
    content["accept"] = {"sep": spheres}
    with browser.opened(written(content, file, tmp_path)) as page:
        assert page.locator(".what-if .filter").count() == 0
        compare(page, file, 2)


def test_sigmas_of_a_reentry(browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Correlated errors, means, distributions, a circle and boxes of two and three sides."""
    file = str(CAMPAIGNS / "08_every_option.toml")
    content = tomllib.loads(Path(file).read_text(encoding="utf-8"))
    content["accept"]["box"].append(
        {"within": {"altitude": "15 km", "range": "20 km", "range_rate": "6 m/s"}, "probability": 0.9}
    )
    with monkeypatch.context() as quick:
        quick.setattr("mcnav.analysis.linear_answer.smallest_reaching", lambda *_: 1.0)  # margins of the page's own
        written(content, file, tmp_path)
    with browser.opened(tmp_path / "lincov.html") as page:
        compare(page, file, 3)


CHOSEN = """(factors) => {
  const root = document.querySelector(".what-if");
  root.choose(factors);
  return {...root.results(), state: root.querySelector(".state").textContent,
    findings: Array.from(root.querySelectorAll(".requirements .tag"), (tag) => tag.textContent)};
}"""


def test_numbers_for_which_linear_analysis_does_not_hold_are_marked(browser: Browser, tmp_path: Path) -> None:
    """Campaign 14: to fourth order y has the variance ``s_r^2 + r^2 s_a^4 / 2 - s_r^2 s_a^2``, linearly ``s_r^2``.

    The differences of its derivatives, by a fifth of a sigma, are good to 1e-3 at 15 degrees.
    """
    file = str(CAMPAIGNS / "14_polar.toml")
    limit = {"output": "y", "probability": 0.95, "below": "3 km"}
    content = tomllib.loads(Path(file).read_text(encoding="utf-8")) | {"accept": {"quantile": [limit]}}
    answer = linear_covariance(parse_campaign(content, file, "what if"), examine=True)
    path = tmp_path / "lincov.html"
    path.write_text(page_html(lincov_page(answer, {}, what_if_of_answer(answer, content, "here"))), encoding="utf-8")
    with browser.opened(path) as page:
        for distance, bearing in ((1.0, 0.2), (1.0, 0.5), (10.0, 1.0), (0.1, 0.2), (30.0, 0.3)):
            chosen = page.evaluate(CHOSEN, {"errors.range": distance, "errors.bearing": bearing})
            s_r, s_a = 20.0 * distance, np.deg2rad(15.0) * bearing
            true = np.sqrt(s_r**2 + 0.5e6 * s_a**4 - s_r**2 * s_a**2)
            assert chosen["ratios"][1] == pytest.approx(true / s_r, rel=2e-3)
            doubted = abs(true / s_r - 1.0) > 0.8 * 0.05
            assert (1 in chosen["departing"]) == doubted
            assert chosen["findings"] == ["not linear: simulate" if doubted else "met"]
            assert ("Linear analysis does not hold with these numbers" in chosen["state"]) == bool(chosen["departing"])


DECK = """async () => {
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  const figure = document.querySelector("#figure-deck");
  const data = JSON.parse(figure.querySelector(":scope > script").textContent);
  return [data.times[document.querySelector(".clock input").value],
    data.causes.map(([name]) => figure.querySelector(`.series-${name} path`).dataset.tip),
    figure.querySelectorAll(".ghost").length, figure.querySelector(".shows").textContent];
}"""
"""Instant of the flight deck, its causes in words, how many have a mark of the campaign's share, and its sentence."""

BEGINNINGS = {"gyros": "gyro_", "accelerometers": "accelerometer_", "gnss": "gnss_", "altimeter": "altimeter_"}


def compare_deck(page: Any, answer: LinearAnswer, campaign: LinearAnswer) -> None:
    """Compare the deck's causes with the shares of linear covariance analysis in the variance of north and east.

    Shares are shown to a tenth of a per cent, the ratio of sigmas with three digits.
    """
    time, told, ghosts, said = page.evaluate(DECK)
    history, before = answer.history, campaign.history
    assert history is not None
    assert before is not None
    at = int(history.settled[np.argmin(np.abs(history.readings.times[history.settled] - 60.0 * time))])
    added = {name: float(values[at, :2].sum()) for name, values in history.variances.items()}
    expected = dict.fromkeys(["initial errors", *BEGINNINGS], 0.0)
    for name, part in added.items():
        origin = next((each for each, begin in BEGINNINGS.items() if name.startswith(begin)), "initial errors")
        expected[origin] += 100.0 * part / sum(added.values())
    shown = dict(re.fullmatch(r"(.+): ([\d.]+) %, in the campaign [\d.]+ %", each).groups() for each in told)  # type: ignore[union-attr]
    assert {name: float(share) for name, share in shown.items()} == pytest.approx(expected, abs=0.0501)
    assert ghosts == len(expected)
    ratio = float(np.sqrt(sum(added.values()) / (before.sigma[at, :2] ** 2).sum()))
    factor = re.search(r"With the numbers of What if, the filter's gains held: .*is ([\d.]+) times", said)
    assert factor is not None
    assert float(factor[1]) == pytest.approx(ratio, rel=6e-3)


def test_report_of_a_run(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """The file that it copies is one of its folder; its sigmas are those after updates; the deck's causes follow."""
    report = page_of("aided")
    campaign = answer_linearly(read_campaign(report.parent / "campaign.toml"))
    with browser.opened(report) as page:
        for found in settings(page, 4):
            (report.parent / "what_if.toml").write_text(found["toml"], encoding="utf-8")
            answer = answer_linearly(read_campaign(report.parent / "what_if.toml"))
            assert answer.history is not None
            settled = answer.history.sigma[answer.history.settled]
            np.testing.assert_allclose(np.array(found["sigmas"])[:-1], settled, rtol=1e-6)
            np.testing.assert_allclose(found["sigmas"][-1], answer.sigma, rtol=1e-6)
        compare_deck(page, answer, campaign)


def test_by_keyboard(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """Arrow keys move a slider, a typed value is taken, a wrong one is refused; reset, and copy."""
    with browser.opened(page_of("report")) as page:
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        before = page.evaluate(RESULTS)
        slider, typed = (
            page.get_by_role("slider", name="errors.altitude", exact=True),
            page.get_by_label("errors.altitude in m"),
        )
        state, reset = page.locator(".what-if .state"), page.get_by_role("button", name="Reset")
        assert state.inner_text().startswith("As in the campaign.")
        assert reset.is_disabled()
        slider.press("ArrowRight")
        assert "5240 m" in (slider.get_attribute("aria-valuetext") or "")
        assert state.inner_text().startswith("1 number changed.")
        typed.fill("10000")
        typed.press("Enter")
        ratio = np.array(page.evaluate(RESULTS)["sigmas"])[-1] / np.array(before["sigmas"])[-1]
        assert "10000 m, 2.00 times" in (slider.get_attribute("aria-valuetext") or "")
        assert (ratio >= 1.0).all()
        assert ratio.max() > 1.2
        typed.fill("-3 km")
        typed.press("Enter")
        assert typed.get_attribute("aria-invalid") == "true"
        assert (np.array(page.evaluate(RESULTS)["sigmas"])[-1] / before["sigmas"][-1] == ratio).all()
        page.get_by_role("button", name="Copy as TOML").press("Enter")
        page.get_by_role("button", name="Copied").wait_for()
        copied = page.evaluate("navigator.clipboard.readText()")
        assert tomllib.loads(copied)["errors"]["altitude"] == "10000 m"
        assert "#   errors.altitude: 5000 becomes 10000 m" in copied.splitlines()
        reset.press("Enter")
        assert page.evaluate(RESULTS) == before
        assert typed.input_value() == "5000"


UNFOLD_NUMBERS = "document.querySelectorAll('.what-if details').forEach((fold) => { fold.open = true; })"
"""Opens what is folded of the numbers."""


def test_grades_are_one_click_away(browser: Browser, page_of: Callable[[str], Path]) -> None:
    with browser.opened(page_of("aided")) as page:
        page.evaluate(UNFOLD_NUMBERS)
        row = page.locator(".what-if .row", has=page.get_by_label("imu.gyro.bias", exact=True))
        row.locator(".grade", has_text="N").click()
        assert tomllib.loads(page.evaluate(RESULTS)["toml"])["imu"]["gyro"]["bias"] == "0.008 deg/h"


def test_nothing_to_change(browser: Browser) -> None:
    """A campaign whose errors have no size that a file states has no such section."""
    answer = answer_linearly(campaign(1))
    assert what_if_of_answer(answer, {"scenario": {"type": "reentry"}}, "") is None


def test_sliders_in_a_notebook(browser: Browser, page_of: Callable[[str], Path], tmp_path: Path) -> None:
    """The section stands in a frame of the notebook's page, and its script runs there."""
    shown = mcnav.open_run(page_of("report").parent).what_if
    assert shown is not None
    cell = tmp_path / "cell.html"
    cell.write_text(f'<!doctype html><meta charset="utf-8">{shown._repr_html_()}', encoding="utf-8")
    with browser.opened(cell, silent=False) as page:
        frame = page.frame_locator("iframe")
        frame.get_by_role("slider", name="errors.altitude", exact=True).press("ArrowRight")
        assert frame.locator(".state").inner_text().startswith("1 number changed.")


def test_a_box_of_outputs_that_nearly_determine_each_other(browser: Browser, tmp_path: Path) -> None:
    """The page's own quadrature against `normal_box_probability`, to the last digit that it shows."""
    written_by = (resources.files("mcnav.report.document") / "templates" / "what_if.js").read_text(encoding="utf-8")
    functions = written_by[written_by.index("  // The error function") : written_by.index('  all(".what-if")')]
    random, cases = np.random.default_rng(5), []
    for thin in (1.0, 1e-2, 1e-4, 1e-6):
        for size in (2, 3):
            root = random.standard_normal((size, size)) * np.array([1.0, *(size - 1) * [thin]])
            covariance = root @ root.T
            sigmas = np.sqrt(np.diag(covariance))
            mean, limits = 0.5 * sigmas * random.standard_normal(size), sigmas * random.uniform(0.5, 3.0, size)
            cases.append((limits, mean, covariance))
    page_file = tmp_path / "empty.html"
    page_file.write_text("<!doctype html><html lang='en'><title>empty</title></html>", encoding="utf-8")
    with browser.opened(page_file, silent=False) as page:
        computed = page.evaluate(
            f"(cases) => {{ const {{ abs, max, min }} = Math; {functions} return cases.map((c) => withinBox(...c)); }}",
            [[values.tolist() for values in case] for case in cases],
        )
    expected = [normal_box_probability(mean, covariance, limits) for limits, mean, covariance in cases]
    assert computed == pytest.approx(expected, abs=1e-6)
