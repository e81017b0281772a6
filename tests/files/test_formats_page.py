"""The page about formats says what the records say, and these what the tests and readers do."""

from pathlib import Path

import pytest

from dvr_cli.files.formats import REGISTRY
from dvr_cli.files.formats_page import formats_page

ROOT = Path(__file__).parents[2]


def test_the_page_is_made_from_the_records():
    page = (ROOT / "docs/formats.md").read_text(encoding="utf-8")
    assert page == formats_page(), "python -m dvr_cli.files.formats_page > docs/formats.md"


@pytest.mark.parametrize("record", [r for r in REGISTRY if r.checked_by], ids=lambda record: record.name)
def test_readers_named_are_those_that_tests_need(record):
    package = record.reader.split(".")[0]
    tests = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "tests/files").glob("*.py")}
    about = [text for name, text in tests.items() if package in name or f"dvr_cli.files.{package}" in text]
    for reader in record.checked_by:
        assert any(f'require("{reader}")' in text for text in about), reader


@pytest.mark.parametrize("record", [r for r in REGISTRY if r.patched], ids=lambda record: record.name)
def test_what_is_patched_does_without_meshio(record):
    module = ROOT / "dvr_cli/files" / record.reader.replace(".", "/")
    files = [module.with_suffix(".py")] if module.with_suffix(".py").exists() else list(module.glob("*.py"))
    assert files
    for path in files:
        assert "import meshio\n" not in path.read_text(encoding="utf-8")
    assert record.versions
