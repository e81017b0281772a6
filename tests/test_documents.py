"""What code and documents cite is there: pages and sections of docs/, files, and tests of guarantees."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("dvr_cli", "tests", "benchmarks", "examples", "sample_meshes")
SOURCES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/**/*.md"))]
_PAGE = re.compile(r"\bdocs/(\w+\.md)(?:,? \"([^\"]+)\")?")
_LINK = re.compile(r"\]\(([^)#\s]*)(?:#([\w-]+))?\)")
_TEST = re.compile(r"`(tests/[\w/]+\.py)(?:::(\w+))?`")
_SOURCE = re.compile(r"`([\w/]+\.py)`")


def headings(page: Path) -> list[str]:
    return re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)


def anchor(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def cited_by(text: str) -> list[tuple[str, str]]:
    """The pages that a source cites, each with the section, if any; lines may be broken anywhere."""
    return _PAGE.findall(re.sub(r"\s+#?\s*", " ", text))


def docstrings(path: Path) -> Iterator[str]:
    """Those of a module and of all that it defines."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            yield ast.get_docstring(node) or ""


def test_docstrings_of_the_package_are_sentences_about_the_thing():
    """As CONTRIBUTING.md has it: they do not begin with What, Where, How, Whether or Which."""
    question = re.compile(r"(What|Where|How|Whether|Which)\b")
    found = [(name(path), text) for path in (ROOT / "dvr_cli").rglob("*.py") for text in docstrings(path)]
    assert len(found) > 1000
    assert [each for each in found if question.match(each[1])] == []


def test_citations_are_found():
    text = 'in docs/design.md, "The line\n# problem", and (docs/glossary.md)'
    assert cited_by(text) == [("design.md", "The line problem"), ("glossary.md", "")]


def test_pages_and_sections_that_code_cites_are_there():
    citations = [
        (name(path), *cited)
        for path in SOURCES
        if path != Path(__file__)
        for cited in cited_by(path.read_text(encoding="utf-8"))
    ]
    assert citations
    sections = {page.name: headings(page) for page in ROOT.glob("docs/*.md")}
    assert [c for c in citations if c[1] not in sections or (c[2] and c[2] not in sections[c[1]])] == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_links_lead_somewhere(document):
    for path, section in _LINK.findall(document.read_text(encoding="utf-8")):
        if "://" in path:
            continue
        page = document.parent / path if path else document
        assert page.exists(), path
        if section:
            assert section in [anchor(heading) for heading in headings(page)], section


@pytest.mark.parametrize("document", DOCUMENTS, ids=name)
def test_tests_and_modules_that_documents_name_are_there(document):
    text = document.read_text(encoding="utf-8")
    for path, function in _TEST.findall(text):
        assert (ROOT / path).is_file(), path
        if function:
            assert f"def {function}(" in (ROOT / path).read_text(encoding="utf-8"), function
    for path in _SOURCE.findall(text):
        assert any((folder / path).is_file() for folder in (ROOT, ROOT / "dvr_cli")), path
