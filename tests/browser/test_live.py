"""The live page: what its reader does, and the server's answers."""

from __future__ import annotations

from pathlib import Path

from mcnav.studies.live import LiveCampaign
from tests.browser.accessibility import violations
from tests.browser.conftest import Browser
from tests.browser.test_first_screen import NUMBERS, SEEN, WORDS
from tests.campaigns.test_live import FILTERED, filtered, served
from tests.processes import LONG

__all__ = ["filtered"]


def test_a_reader_tunes_confirms_and_changes_the_file(browser: Browser, filtered: Path, tmp_path: Path) -> None:
    """A slider is moved and released: the filter is re-tuned, the setting run; then the file is damaged and mended.

    The first screen has sliders, grey until they are moved, curves and a banner that follows them.
    """
    with (
        served(LiveCampaign(filtered, tmp_path / "runs", 1)) as server,
        browser.visited(server.address, folded=True) as page,
    ):
        words, numbers = page.evaluate(SEEN)
        assert words <= WORDS
        assert numbers <= NUMBERS
        banner, row = page.locator(".first-screen .verdict"), page.locator(".what-if .row", has_text="gnss position")
        before = banner.inner_text()
        slider = row.locator("input[type=range]")
        assert "grayscale" in slider.evaluate("each => getComputedStyle(each).filter")
        slider.evaluate("each => { each.value = 0.5; each.dispatchEvent(new Event('input')); }")
        assert banner.inner_text().endswith("Release to re-tune.")
        assert slider.evaluate("each => getComputedStyle(each).filter") == "none"
        page.get_by_role("button", name="Reset").click()
        assert banner.inner_text() == before
        box = page.get_by_label("aiding.gnss.position in m", exact=True)
        box.fill("9")
        box.press("Tab")
        page.locator(".told a").click()
        column = page.locator(".live thead th").nth(1)
        column.wait_for()
        assert "The requirement is not met" in page.locator(".told").inner_text()
        assert banner.inner_text().startswith("The filter is optimistic")  # the worst of the re-tuned answer
        assert page.locator(".what-if path.again").first.get_attribute("d")
        page.get_by_role("button", name="Confirm Setting 1 by Monte Carlo").click()
        page.locator(".live .said", has_text="Setting 1 by Monte Carlo: ").wait_for(timeout=1e3 * LONG)
        with page.expect_popup() as popup:
            page.get_by_role("link", name="Report").click()
        assert "a filter" in popup.value.locator("h1").inner_text()
        popup.value.close()
        page.get_by_role("button", name="Reset").click()
        page.get_by_role("button", name="Set the sliders").nth(1).click()
        assert box.input_value() == "9"
        filtered.write_text(FILTERED.replace('position = "10 m', 'position = "10 kg'), encoding="utf-8")
        page.locator(".alarm", has_text="errors.position").wait_for()
        assert page.locator(".alarm").inner_text().startswith(f"{filtered}: errors.position: ")
        assert column.inner_text().startswith("Setting 1")
        assert violations(page, {}, ".live") == []
        filtered.write_text(FILTERED.replace('below = "10 m"', 'below = "5 m"'), encoding="utf-8")
        page.locator(".live", has_text="The requirement is not met").wait_for(state="attached")
        page.locator(".live", has_text="of an earlier file").wait_for(state="attached")
        page.locator(".alarm").wait_for(state="hidden")
        assert box.input_value() == "9"  # the sliders stay, but those whose number the file has changed
        filtered.write_text(FILTERED.replace('position = "3 m"', 'position = "4 m"'), encoding="utf-8")
        page.wait_for_function("() => document.querySelector('.what-if .state')?.textContent.startsWith('As in')")
        assert box.input_value() == "4"
