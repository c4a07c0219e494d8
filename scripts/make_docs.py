"""Remakes what in docs/ is made by the program itself: the commands, the interface, the schema, the
table of mistakes and the figures.

usage: python scripts/make_docs.py [OUTPUT]   (docs/ when absent)

docs/figures/episode-view.png needs a recorded episode and a browser: see scripts/screenshot_view.py.
"""

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scripts import command_outputs  # noqa: E402 - found from any directory only now
from scripts.api_page import api_page  # noqa: E402 - found from any directory only now
from scripts.mistakes_page import mistakes_page  # noqa: E402 - found from any directory only now
from scripts.schema_page import schema_page  # noqa: E402 - found from any directory only now

LOOK_WIDTH_PX = 1400
LOOK_JPEG_QUALITY = 88
"""The README opens with it: two thirds of the bytes of 95, and no difference to the eye."""
HELP_COLUMNS = 100
PREAMBLE = """# Commands

Every command's `--help`. This page is made by `make docs`.
"""


def command_reference() -> str:
    """Return docs/cli.md."""
    from typer.main import get_command

    from vsnbench.cli.main import VERBS, build_app

    parts = [PREAMBLE, _section((), _help(None))]
    for verb in VERBS:
        parts.append(_section((verb,), _help(verb)))
        group = get_command(build_app(verb)).commands[verb]  # type: ignore[attr-defined]
        parts += [_section((verb, name), _help(verb, name)) for name in getattr(group, "commands", ())]
    return "\n".join(parts)


def _section(words: tuple[str, ...], text: str) -> str:
    title = " ".join(("vsnbench", *words))
    level = "##" if len(words) < 2 else "###"
    return f"{level} {title}\n\n```text\n{text}\n```\n"


def _help(verb: str | None, *more: str) -> str:
    from typer.testing import CliRunner

    from vsnbench.cli.main import build_app

    words = [*([verb] if verb else []), *more, "--help"]
    environment = {"COLUMNS": str(HELP_COLUMNS), "NO_COLOR": "1", "TERM": "xterm", "FORCE_COLOR": None}
    answer = CliRunner().invoke(build_app(verb), words, prog_name="vsnbench", env=environment)
    if answer.exit_code:
        raise SystemExit(f"vsnbench {' '.join(words)} ended with {answer.exit_code}: {answer.output}")
    return "\n".join(line.rstrip() for line in answer.stdout.strip("\n").splitlines()).strip("\n")


def draw_figures(folder: Path) -> None:
    """Draw the embedded apartment's plan and look."""
    import cv2

    from vsnbench.protocol.site import load_site
    from vsnbench.report.plan.floor_plan import save_floor_plan
    from vsnbench.simulator.contact_sheet import contact_sheet

    site = load_site("apartment")
    save_floor_plan(site, folder / "apartment-plan.svg")
    save_floor_plan(site, folder / "apartment-plan.png")
    sheet = contact_sheet(site)
    height = round(sheet.shape[0] * LOOK_WIDTH_PX / sheet.shape[1])
    look = cv2.resize(sheet, (LOOK_WIDTH_PX, height), interpolation=cv2.INTER_AREA)[..., ::-1]
    cv2.imwrite(str(folder / "apartment-look.jpg"), look, [cv2.IMWRITE_JPEG_QUALITY, LOOK_JPEG_QUALITY])


def main(docs: Path) -> None:
    (docs / "figures").mkdir(parents=True, exist_ok=True)
    (docs / "cli.md").write_text(command_reference(), encoding="utf-8")
    (docs / "api.md").write_text(api_page(), encoding="utf-8")
    (docs / "schema.md").write_text(schema_page(), encoding="utf-8")
    (docs / "survey-mistakes.md").write_text(mistakes_page(), encoding="utf-8")
    draw_figures(docs / "figures")
    command_outputs.main()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", nargs="?", type=Path, default=ROOT / "docs")
    main(parser.parse_args().directory)
