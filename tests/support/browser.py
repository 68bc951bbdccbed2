"""A page in headless Chromium: what a visitor sees and does."""

from __future__ import annotations

import io
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader")
FLAGS += ("--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


class Page:
    """A page that is open."""

    def __init__(self, driver: webdriver.Chrome) -> None:
        self.driver = driver

    def open(self, address: str) -> None:
        self.driver.get(address)

    def image(self, path: Path | None = None) -> np.ndarray:
        """Return what the window shows, shape [row column 3], after drawing is done."""
        image = Image.open(io.BytesIO(self.driver.get_screenshot_as_png())).convert("RGB")
        if path:
            path.parent.mkdir(parents=True, exist_ok=True)
            image.save(path)
        return np.asarray(image)

    def text(self) -> str:
        return self.driver.find_element(By.TAG_NAME, "body").text

    def press(self, caption: str) -> None:
        """Click the button or tab with this caption, or one that begins so."""
        path = (
            f"//*[self::button or @role='tab'][starts-with(translate(normalize-space(.), '\u2003', ''), '{caption}')]"
        )
        self.driver.find_element(By.XPATH, path).click()

    def tick(self, caption: str) -> None:
        """Click the checkbox with this caption."""
        self._input(caption).click()

    def type(self, caption: str, value: float) -> None:
        """Write a number into the box beside the slider with this caption."""
        box = self._row(caption).find_element(By.XPATH, ".//input[@type='text' or @inputmode]")
        box.send_keys(Keys.CONTROL, "a")
        box.send_keys(f"{value:g}", Keys.TAB)

    def click(self, x: float, y: float) -> None:
        """Click a place in the window [pixel]."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            event = {
                "type": kind,
                "x": x,
                "y": y,
                "button": "left" if kind != "mouseMoved" else "none",
                "clickCount": 1,
            }
            self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)
            time.sleep(0.1)

    def wait(self, done: Callable[[], bool], seconds: float) -> float:
        """Wait until something is true; return how long that took [s]."""
        start = time.monotonic()
        while not done():
            if time.monotonic() - start > seconds:
                raise TimeoutError(f"not within {seconds:g} s: {self.text()[:500]}")
            time.sleep(0.05)
        return time.monotonic() - start

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]

    def _label(self, caption: str):
        return self.driver.find_element(By.XPATH, f"//label[normalize-space(.)='{caption}']")

    def _row(self, caption: str):
        return self._label(caption).find_element(By.XPATH, "./ancestor::div[contains(@class, 'Flex')][1]")

    def _input(self, caption: str):
        return self._row(caption).find_element(By.TAG_NAME, "input")


@contextmanager
def browser(width: int = 1280, height: int = 800) -> Iterator[Page]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--window-size={width},{height}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )
    try:
        yield Page(driver)
    finally:
        driver.quit()
