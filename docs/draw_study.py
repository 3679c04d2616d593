"""Draws the pictures of docs/how-to/studies.md: `python docs/draw_study.py`; needs playwright and Chromium."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

IMAGES = Path(__file__).parent / "images"
STUDY = Path(__file__).parent.parent / "examples" / "studies" / "passing.yaml"
SCALE = 1.5  # pixels of a picture per pixel of the page


def opened(browser: Browser, link: str, width: int, height: int) -> Page:
    page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=SCALE)
    page.goto(link)
    return page


def prepare(page: Page) -> None:
    """Go on to the first run."""
    page.get_by_role("button", name="Continue").click()
    for statement in page.get_by_role("checkbox").all():
        statement.check()
    page.get_by_role("button", name="I agree").click()
    page.get_by_label("How old are you?").fill("30")
    page.get_by_role("radio", name="sometimes").check()
    page.get_by_role("button", name="Continue").click()
    page.get_by_text("First a run to practise.").wait_for()
    page.get_by_role("button", name="Continue").click()
    drive(page, 500)
    page.get_by_role("button", name="End the run").click()
    page.get_by_role("button", name="Continue", exact=True).click()
    page.wait_for_selector("#status.waiting")


def drive(page: Page, ms: int) -> None:
    page.wait_for_selector("#status.waiting")
    page.locator("#canvas").focus()
    page.keyboard.up("w")
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(ms)


def draw(links: dict[str, str]) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        phone = opened(browser, links["p002"], 390, 760)
        prepare(phone)
        drive(phone, 3500)
        phone.screenshot(path=IMAGES / "study_phone.png")
        laptop = opened(browser, links["p001"], 1000, 760)
        prepare(laptop)
        researcher = opened(browser, links["researcher"], 1100, 900)
        researcher.get_by_role("button", name="p001").click()
        laptop.bring_to_front()
        drive(laptop, 3500)
        researcher.screenshot(path=IMAGES / "study_researcher.png")
        browser.close()


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        command = f"-m sonata2d_cli serve {STUDY} {folder}/out --port 0 --participants 4 --json"
        server: subprocess.Popen[Any] = subprocess.Popen(
            [sys.executable, *command.split()], stdout=subprocess.PIPE, text=True
        )
        assert server.stdout
        words = ""
        while not words.rstrip().endswith("}"):
            words += server.stdout.readline()
        try:
            draw(json.loads(words))
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
