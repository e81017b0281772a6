"""The page about options says what their table says."""

import re
from pathlib import Path

from dvr_cli.cli.options_page import options_page
from dvr_cli.options import TABLE

PAGE = Path(__file__).parents[2] / "docs/options.md"


def test_the_page_is_made_from_the_table():
    page = PAGE.read_text(encoding="utf-8")
    assert page == options_page(), "python -m dvr_cli.cli.options_page > docs/options.md"


def test_each_option_has_a_row_with_its_commands_and_defaults():
    rows = [line for line in options_page().splitlines() if line.startswith("| `-")]
    assert len(rows) == len(TABLE)
    by_name = {name: row for row in rows for name in re.findall(r"--[\w-]+", row.split("`")[1])}
    assert "`smooth` (0), `morph` (0)" in by_name["--seed"]
    assert "`smooth` (auto), `untangle` (ideal), `morph` (input)" in by_name["--shape"]
    assert "`report quality` (10)" in by_name["--worst"]
