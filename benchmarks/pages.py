"""Pictures of all pages of a study, and what axe says of their accessibility.

python benchmarks/pages.py FOLDER [--axe node_modules/axe-core/axe.min.js] [--widths 360 768 1440]

Participants go through a study in German and Chinese, in light and dark, at each width; FOLDER gets a picture of every
state of their pages and of the researcher's. With `--axe` (`npm install axe-core`), each state is checked as well.
Needs playwright and Chromium.
"""

from __future__ import annotations

import argparse
import itertools
import json
import shutil
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Literal

from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright
from study_server import served_study

import sonata2d as s2

SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
HEIGHTS = {360: 740, 768: 1024, 1440: 900}
STUDY = """\
title: {de: Ein Roboter unter Menschen, zh: 人群中的机器人}
languages: [de, zh]
pages: [{title: {de: Willkommen, zh: 欢迎}, text: {de: "- **eins**\\n- zwei", zh: "- **一**\\n- 二"}}]
consent: {title: {de: Einwilligung, zh: 同意书}, text: {de: Fahrten werden gespeichert., zh: 驾驶将被保存。},
  statements: [{de: Ich bin 18 oder älter., zh: 我已年满18岁。}]}
demographics:
  - {name: age, kind: number, integer: true, minimum: 18, question: {de: "Wie alt sind Sie?", zh: 您的年龄？}}
  - {name: games, kind: classes, question: {de: Videospiele, zh: 电子游戏},
     classes: [{de: nie, zh: 从不}, {de: oft, zh: 经常}]}
  - {name: calm, kind: slider, question: {de: Ruhig, zh: 平静},
     ends: [{de: gar nicht, zh: 完全没有}, {de: sehr, zh: 非常}]}
  - {name: remark, kind: text, required: false, question: {de: Bemerkung, zh: 备注}}
practice: {scenario: room.yaml, runs: 1}
runs:
  - scenario: room.yaml
    runs: 2
    label: {question: {de: Höflich, zh: 礼貌}, classes: {de: [grob, gut, nett], zh: [粗鲁, 一般, 友好]}}
after_run:
  - {name: felt, kind: likert, points: 7, question: {de: Stimmt das, zh: 您同意吗},
     ends: [{de: nein, zh: 不}, {de: ja, zh: 是}],
     items: {easy: {de: Es war leicht., zh: 很容易。}, polite: {de: Der Roboter war höflich., zh: 机器人有礼貌。}}}
  - {name: often, kind: likert, points: 3, question: {de: Wie oft, zh: 多久一次},
     items: {met: {de: Begegnungen, zh: 相遇}},
     labels: [{de: nie, zh: 从不}, {de: manchmal, zh: 有时}, {de: immer, zh: 总是}]}
ratings:
  - {name: polite, folder: recorded, count: 1,
     question: {name: polite, kind: yes_no, question: {de: Höflich, zh: 礼貌}}}
end: [{scale: godspeed, subscales: [safety]}]
changes: [view, zoom, zones]
"""
ROOM = "extends: lively\nlabel: {kind: classes, classes: [rude, fair, kind], question: How polite were you}\n"


class Recorder:
    """Takes a picture of each state of a page, and lets axe check it.

    Args:
        folder: of the pictures.
        axe: the source of axe; empty for no check.
    """

    def __init__(self, folder: Path, axe: str) -> None:
        self._folder, self._axe = folder, axe
        self.states, self.violations = 0, Counter[str]()

    def note(self, page: Page, name: str) -> None:
        """Record the present state of a page."""
        page.wait_for_timeout(150)
        self.states += 1
        page.screenshot(path=self._folder / f"{name}.png", full_page=True)
        width = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        if width > 0:
            self.violations["wider than the window"] += 1
            print(f"{name}: {width} pixels wider than the window", file=sys.stderr)
        if self._axe:
            page.evaluate(self._axe)
            for found in page.evaluate("axe.run()")["violations"]:
                self.violations[found["id"]] += 1
                print(f"{name}: {found['help']}: {found['nodes'][0]['html'][:200]}", file=sys.stderr)


def go_on(page: Page) -> None:
    page.locator("#step button.primary").first.click()


def drive(page: Page, ms: int = 600) -> None:
    page.locator("#canvas").focus()
    page.keyboard.down("w")
    page.wait_for_selector("#status.driving")
    page.wait_for_timeout(ms)


def end(page: Page) -> None:
    page.keyboard.up("w")
    page.keyboard.press("Enter")
    page.wait_for_selector("#card:not([hidden])")
    page.wait_for_timeout(600)


def answer_tables(page: Page) -> None:
    for row in page.locator(".table .row[role=radiogroup]").all():
        row.locator("label.choice").nth(1).click()
    page.locator("#step form button[type=submit]").click()
    page.wait_for_selector("#step form", state="hidden")


def walk(page: Page, recorder: Recorder, prefix: str) -> None:
    """Go through the study as a participant."""
    numbers = itertools.count(1)

    def note(name: str) -> None:
        recorder.note(page, f"{prefix}-{next(numbers):02d}-{name}")

    page.wait_for_selector("#step:not([hidden]) #title")
    note("page")
    go_on(page)
    page.wait_for_selector(".tick")
    go_on(page)
    note("consent")
    page.get_by_role("checkbox").check()
    go_on(page)
    page.wait_for_selector("#step form")
    page.locator("#step form button[type=submit]").click()
    note("questions")
    page.locator("input[type=number]").fill("30")
    page.locator(".choice").first.click()
    page.locator("input[type=range]").press("ArrowRight")
    page.locator("#step form button[type=submit]").click()
    page.wait_for_selector("#status.waiting")
    note("waiting")
    drive(page)
    note("driving")
    end(page)
    note("practice")
    page.locator("#confirm").click()
    for run in range(2):
        page.wait_for_selector("#status.waiting")
        drive(page)
        if run == 0:
            page.keyboard.press("F1")
            page.wait_for_selector("#help[open]")
            note("help")
            page.locator("#help-close").click()
            page.wait_for_selector("#status.paused")
            note("paused")
            page.keyboard.up("w")
            drive(page, 200)
        end(page)
        if run == 0:
            page.locator("#confirm").click()
            note("card")
        page.locator("#card .choice").first.click()
        page.locator("#confirm").click()
        page.wait_for_selector("#step form")
        if run == 0:
            note("after-run")
        answer_tables(page)
    page.wait_for_selector("#watching:not([hidden])")
    note("rating")
    page.wait_for_selector("#rating input:not(:disabled)", timeout=90_000)
    note("rating-end")
    page.locator("#rating .choice").first.click()
    page.locator("#save").click()
    page.wait_for_selector("#step form")
    note("closing")
    answer_tables(page)
    note("thanks")


def record_all(browser: Browser, links: dict[str, str], widths: list[int], recorder: Recorder) -> None:
    """Record all pages in all widths, languages and colour schemes."""

    def opened(link: str, width: int, scheme: Literal["light", "dark"], locale: str = "de-DE") -> Page:
        size = ViewportSize(width=width, height=HEIGHTS.get(width, 900))
        context = browser.new_context(viewport=size, color_scheme=scheme, locale=locale, bypass_csp=True)
        page = context.new_page()
        page.set_default_timeout(20_000)
        page.on("pageerror", lambda error: recorder.violations.update(["error in the page"]))
        page.goto(link)
        return page

    tokens = iter([link for name, link in links.items() if name.startswith("p")])
    for width, locale, scheme in itertools.product(widths, ("de-DE", "zh-CN"), SCHEMES):
        page = opened(next(tokens), width, scheme, locale)
        walk(page, recorder, f"{locale[:2]}-{width}-{scheme}")
        page.context.close()
    for width, scheme in itertools.product(widths, SCHEMES):
        for name in ("researcher", "open link"):
            page = opened(links[name], width, scheme)
            page.wait_for_timeout(1500)
            recorder.note(page, f"{name.replace(' ', '-')}-{width}-{scheme}")
            page.context.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--axe", type=Path)
    parser.add_argument("--widths", type=int, nargs="+", default=list(HEIGHTS))
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    recorder = Recorder(options.folder, options.axe.read_text(encoding="utf-8") if options.axe else "")
    with tempfile.TemporaryDirectory() as name:
        study = Path(name) / "study.yaml"
        study.write_text(STUDY, encoding="utf-8")
        (study.parent / "room.yaml").write_text(ROOM)
        scenario = s2.load_scenario("sonata-2020").changed(rules={"time_limit": 3.0})
        s2.generate_dataset(study.parent / "recorded", scenario, "straight-to-goal", episodes=1, workers=1)
        with served_study(study.parent, 4 * len(options.widths)) as (_, links), sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
            record_all(browser, links, options.widths, recorder)
            browser.close()
    print(json.dumps({"states": recorder.states, "violations": recorder.violations}, indent=2))


if __name__ == "__main__":
    main()
