"""A page in a browser without a screen: Debian's Chromium, driven by Selenium."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

Open = Callable[..., Any]
SWITCHES = ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1280,1000")


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A browser; its log has all errors, its performance log all requests."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="no selenium")
    from selenium.webdriver.chrome.service import Service

    driver = shutil.which("chromedriver")
    if driver is None or shutil.which("chromium") is None:
        pytest.skip("no chromium and chromedriver: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    for switch in SWITCHES:
        options.add_argument(switch)
    options.binary_location = shutil.which("chromium")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    browser = webdriver.Chrome(options, Service(driver))
    browser.set_page_load_timeout(120)
    yield browser
    browser.quit()


@pytest.fixture
def opened(chromium: Any, tmp_path: Path) -> Open:
    """Opens a page, and waits for what it draws."""

    def opened(page: str, name: str = "page.html") -> Any:
        path = tmp_path / name
        path.write_text(page, encoding="utf-8", newline="\n")
        chromium.get_log("browser")
        chromium.get(path.as_uri())
        drawn(chromium)
        return chromium

    return opened


def drawn(browser: Any) -> None:
    """Wait until all that was asked for is drawn."""
    browser.execute_async_script(
        "const [done] = arguments; requestAnimationFrame(() => requestAnimationFrame(done))"
    )
