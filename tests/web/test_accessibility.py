"""All pages under axe-core, whose rules follow WCAG 2.2, in light and in dark."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .conftest import Served, answering
from .test_browser import answer_effort, drive_with_keys, end, go_on, opened, waiting

pytest.importorskip("axe_playwright_python")
SCHEMES = pytest.mark.parametrize("scheme", ["light", "dark"])


def require_accessible(tab: Any, what: str) -> None:
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(tab).response["violations"]
    problems = [
        f"{rule['id']}: {node['html'][:160]} {node['failureSummary']}" for rule in found for node in rule["nodes"]
    ]
    assert not problems, f"{what}: " + "\n".join(problems)


@SCHEMES
@pytest.mark.parametrize("width", [360, 1000])
def test_every_step_of_a_study(browser: Any, served: Served, scheme: str, width: int) -> None:
    settings = {
        "bypass_csp": True,
        "color_scheme": scheme,
        "reduced_motion": "reduce",
    }  # axe runs as a script of the page
    tab = opened(browser, f"{served.url}/j/{served.links.open}", **settings)
    tab.set_viewport_size({"width": width, "height": 760})

    def check(what: str) -> None:
        require_accessible(tab, f"{what}, {scheme}, {width} px")

    check("open link")
    tab.get_by_role("button").click()
    tab.wait_for_selector("#step:not([hidden]) #title")
    check("page")
    go_on(tab)
    check("consent")
    tab.get_by_role("button", name="I agree", exact=True).click()
    check("consent, incomplete")
    tab.get_by_label("I am 18 or older.").check()
    tab.get_by_role("button", name="I agree", exact=True).click()
    tab.get_by_label("Your age").fill("17")
    go_on(tab)
    check("questions, refused")
    tab.get_by_label("Your age").fill("44")
    go_on(tab)
    waiting(tab)
    check("practice, waiting")
    drive_with_keys(tab, 400)
    check("practice, driving")
    tab.get_by_role("button", name="Help").click()
    tab.wait_for_selector("#help[open]")
    check("help")
    tab.get_by_role("button", name="Close").click()
    end(tab)
    check("practice, ended")
    go_on(tab)
    for run in range(3):
        waiting(tab)
        drive_with_keys(tab, 400)
        end(tab)
        if run == 0:
            check("run, ended")
        tab.get_by_label("fair").check()
        tab.locator("#card").get_by_role("button", name="Keep").click()
        if run == 0:
            tab.wait_for_selector("#step:not([hidden]) #title")
            check("after the run")
        answer_effort(tab, 3)
    tab.wait_for_selector("#watching:not([hidden])")
    check("rating, while it plays")
    tab.wait_for_selector("#rating input:enabled")
    check("rating")
    tab.context.close()


@SCHEMES
def test_the_researchers_page(browser: Any, served: Served, scheme: str) -> None:
    served.link()
    tab = opened(browser, f"{served.url}/r/{served.links.researcher}", bypass_csp=True, color_scheme=scheme)
    tab.get_by_role("button", name="p001").click()
    tab.wait_for_timeout(800)
    require_accessible(tab, f"researcher's page, {scheme}")
    tab.context.close()


@SCHEMES
def test_the_page_of_the_simulator(browser: Any, page: Path, site: str, tmp_path: Path, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 1000, "height": 800}, color_scheme=scheme)
    answering(context, tmp_path)
    tab = context.new_page()
    tab.goto(f"{site}page/index.html?scenario=empty&controller=own")
    tab.wait_for_selector("#status.waiting")
    require_accessible(tab, f"page of the simulator, {scheme}")
    tab.fill("#code", "def f(:\n")
    tab.get_by_role("button", name="Run this code").click()
    tab.wait_for_selector("#problem:not([hidden])")
    require_accessible(tab, f"page of the simulator with a problem, {scheme}")
    context.close()
