"""Saves docs/figures/console/*.webp: each step of the operator's page at phone size.

usage: python scripts/console_screens.py [DIRECTORY]   (about two minutes)

The script runs a rehearsal in the embedded apartment by clicks on two phones, one light and one dark, and saves both
screens at each step, from sign-in to the end.
"""

import os
import random
import re
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.web.blind_study import quiet_port, wait_until
from tests.web.phone import GivenJudgement, Phone, chromium_of_phones, phone_in
from tests.web.tcp_relay import TcpRelay

ROOT = Path(__file__).resolve().parent.parent
SCALE = 1.5
LOADED = "() => [...document.querySelectorAll('#judging img')].every(image => image.naturalWidth)"
QUALITY = 60
SLOW_ORACLE = '''"""The oracle at a real robot's speed."""
import time
from vsnbench.models.baselines.oracle import Oracle as FastOracle

class Oracle(FastOracle):
    def act(self, observation):
        time.sleep(0.4)
        return super().act(observation)
'''
ARGUMENTS = (
    "--model",
    "slow_oracle:Oracle",
    "--goal",
    "chair",
    "--starts",
    "3",
    "--rehearse",
    "--robot",
    "simulated:lola2",
)


class Screens:
    """Saves screenshots of two phones side by side."""

    def __init__(self, phones: list[Phone], folder: Path) -> None:
        self._phones = phones
        self._folder = folder

    def save(self, name: str, scroll_to: str = "") -> None:
        """Save both screens, scrolled to an element if one is given."""
        images = []
        for phone in self._phones:
            if scroll_to:
                phone.page.locator(scroll_to).first.evaluate("element => element.scrollIntoView({ block: 'center' })")
            phone.page.wait_for_timeout(300)
            images.append(cv2.imdecode(np.frombuffer(phone.page.screenshot(), np.uint8), cv2.IMREAD_COLOR))
        gap = np.full((images[0].shape[0], 24, 3), 255, np.uint8)
        file = self._folder / f"{name}.webp"
        cv2.imwrite(str(file), np.hstack([images[0], gap, images[1]]), [cv2.IMWRITE_WEBP_QUALITY, QUALITY])
        print(f"{file.name}  {file.stat().st_size / 1000:.0f} kB", flush=True)


def main(folder: Path) -> None:
    """Run the rehearsal."""
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        port = quiet_port(random.Random())
        log = directory / "log"
        command = [sys.executable, "-m", "vsnbench.cli.main", "run", *ARGUMENTS, f"--console=:{port}"]
        (directory / "slow_oracle.py").write_text(SLOW_ORACLE)
        path = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(directory)])}
        with log.open("w") as sink:
            results = ["--results", str(directory / "results")]
            run = subprocess.Popen([*command, *results], cwd=ROOT, stderr=sink, stdin=-3, env=path)
        stack.callback(run.wait)
        stack.callback(run.kill)
        wait_until(lambda: run.poll() is not None or "token=" in log.read_text(), "the page is served")
        found = re.search(r"http://\S+token=\S+", log.read_text())
        assert found is not None, log.read_text()
        relay = stack.enter_context(TcpRelay(port))
        hosts = ("127.0.0.1", "localhost")
        browser = stack.enter_context(chromium_of_phones(*((host, relay, port) for host in hosts)))
        settings = zip(("Anna", "Ben"), hosts, ("light", "dark"), strict=True)
        phones = [
            phone_in(browser, name, host, relay, found[0], color_scheme=scheme, device_scale_factor=SCALE)
            for name, host, scheme in settings
        ]
        by_clicks(phones, Screens(phones, folder), relay)


def by_clicks(phones: list[Phone], screens: Screens, relay: TcpRelay) -> None:
    """Run one trial and save each screen."""
    anna, ben = phones

    def both(selector: str) -> None:
        for phone in phones:
            phone.page.wait_for_selector(selector, state="visible")

    for phone in phones:
        phone.page.goto(phone.address)
        phone.page.wait_for_selector("#name", state="visible")
    screens.save("1-sign-in")
    for phone in phones:
        phone.sign_in()
    both("#plan svg")
    both("#check")
    screens.save("2-next-trial")
    anna.page.click("#check")
    both("#placement")
    screens.save("3-measured", "#placement")
    screens.save("3-expected-image", ".overlay")
    for _ in range(8):
        if "good" in str(anna.page.get_attribute("#placement", "class")):
            break
        key = anna.page.locator(".overlay img").first.get_attribute("src")
        anna.page.click("#moved")
        anna.page.wait_for_selector(f"#placement, .overlay img:not([src='{key}'])")
        anna.page.wait_for_function("() => !document.getElementById('go').disabled")
    both("#placement")
    screens.save("4-in-place", "#go")
    anna.page.click("#go")
    both("#picture img[src^=blob]")
    anna.page.wait_for_function("() => document.getElementById('driving-steps').textContent.length > 8")
    screens.save("5-driving")
    relay.stall()
    both("#offline")
    screens.save("6-not-connected")
    relay.mend(cut=True)
    for phone in phones:
        phone.page.wait_for_selector("#offline", state="hidden")
    both("#judging .judging-form")
    for phone in phones:
        phone.page.wait_for_function(LOADED)
    screens.save("7-judging")
    for phone in phones:
        phone.fill_judgement("#judging", GivenJudgement("", distance="4 m"))
    screens.save("7-where-it-stopped", "[data-odometry]")
    anna.confirm("#judging", GivenJudgement(""))
    ben.confirm("#judging", GivenJudgement(""))
    both("#dialog")
    screens.save("8-confirmation")
    for phone in phones:
        phone.page.click("#dialog [value=no]")
        phone.fill_judgement("#judging", GivenJudgement("", distance="0.84"))
    anna.confirm("#judging", GivenJudgement(""))
    both("#finish")
    for phone in phones:
        if not phone.page.locator("#episodes").is_visible():
            phone.page.click("#episodes-card summary")
    both(".episode [data-amend]")
    screens.save("9-end")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "figures" / "console")
