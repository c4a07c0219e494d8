"""The verification page states checks, omissions and failures; texts are not markup."""

from collections import Counter
from pathlib import Path

import pytest

from tests.accessibility import accessibility_findings
from tests.cli.chromium import chromium_page
from vsnbench.evidence.verification.checks import Check, Verification
from vsnbench.evidence.verification.page import MAX_FINDINGS, write_page

SCRIPT = "<script>alert(1)</script>"


def page_of(tmp_path: Path, *checks: Check) -> str:
    file = tmp_path / "page.html"
    write_page(Verification("study.zip", "1.2", ("1.1",), checks, {f"Ada {SCRIPT}": 3}), file)
    return file.read_text(encoding="utf-8")


def test_an_intact_record(tmp_path: Path) -> None:
    text = page_of(tmp_path, Check("files", "files", checked=1234, not_checked=Counter({"no digest": 7})))
    for part in (
        "Everything that could be checked holds.",
        "1,234",
        "7 files: no digest",
        "3 verdicts",
        "vsnbench 1.2",
    ):
        assert part in text


def test_findings_are_named_and_texts_of_the_record_are_not_markup(tmp_path: Path) -> None:
    check = Check("values", "rows")
    for number in range(MAX_FINDINGS + 5):
        check.fail(f"step {number}: {SCRIPT}", "changed")
    text = page_of(tmp_path, check)
    assert "The results do not hold." in text
    assert "5 more" in text
    assert text.count("<li>step ") == MAX_FINDINGS
    assert SCRIPT not in text


@pytest.mark.browser
def test_everybody_can_read_the_page_and_the_browser_reports_no_error(tmp_path: Path) -> None:
    page_of(tmp_path, Check("files", "files", checked=1234, not_checked=Counter({"no digest": 7})))
    with chromium_page(1280, 900) as browser:
        messages: list[str] = []
        browser.on("console", lambda message: messages.append(message.text))
        browser.goto((tmp_path / "page.html").as_uri())
        assert accessibility_findings(browser) == []
        assert messages == []
