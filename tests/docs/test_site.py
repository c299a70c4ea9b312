"""The built pages in a browser: none scrolls sideways on a phone, and axe finds nothing, dark or light."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHROMIUM = shutil.which("chromium")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("site")
    subprocess.run([sys.executable, "-m", "sphinx", "-q", "-W", "-c", "host/docs", ".", str(out)], cwd=ROOT, check=True)
    return out


@pytest.mark.nightly
@pytest.mark.skipif(CHROMIUM is None, reason="chromium is missing: apt-get install chromium")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width_px", [390, 1440])
def test_every_page_fits_its_window_and_is_accessible(site: Path, scheme: str, width_px: int) -> None:
    from axe_playwright_python.sync_playwright import Axe
    from playwright.sync_api import sync_playwright

    pages = [page for page in sorted(site.rglob("*.html")) if "_static" not in page.parts]
    assert len(pages) > 50
    wrong = []
    with sync_playwright() as playwright:
        # As in tests/host/view: in a container Chromium has no user name spaces for a sandbox.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": width_px, "height": 844}, color_scheme=scheme)
        for page in pages:
            tab.goto(page.as_uri())
            if tab.evaluate("document.documentElement.scrollWidth") > width_px:
                wrong.append((page.name, "is wider than its window"))
            wrong += [(page.name, found["id"]) for found in Axe().run(tab).response["violations"]]
        browser.close()
    assert wrong == []
