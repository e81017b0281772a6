"""Pictures as files: SVG, PNG and PDF by matplotlib, and a page of HTML that needs nothing beside itself.

matplotlib is only loaded when a picture is asked for. The same picture gives the same bytes.
"""

from __future__ import annotations

import html
import importlib.util
import io
import re
import warnings
from typing import TYPE_CHECKING, Any

from dvr_cli.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 130  # of PNG, and of what is stored as pixels in the others
_UNDATED: dict[str, dict[str, Any]] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {}}
_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ margin: 1.5rem auto; max-width: 80rem; padding: 0 1rem }}
body {{ font: 1rem/1.4 sans-serif; color: #222; background: #fff }}
h1 {{ font-size: 1.2rem; overflow-wrap: anywhere }}
svg {{ width: 100%; height: auto }}
pre {{ overflow-x: auto; font-size: 0.85rem }}
</style>
</head>
<body>
<h1>{title}</h1>
{view}{picture}
<pre>{text}</pre>
</body>
</html>
"""


def check_plotting(what: str) -> None:
    """Raise UsageError if ``what`` cannot be drawn for want of matplotlib."""
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError(f"{what}: pictures need matplotlib: pip install 'dvr-cli[plot]'")


def render(figure: Figure, suffix: str) -> bytes:
    """A figure as a file of the kind ``suffix``, one of ".svg", ".png" and ".pdf"."""
    from matplotlib import rc_context

    data = io.BytesIO()
    with rc_context({"svg.hashsalt": "dvr"}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")  # letters of file names that the font lacks
        figure.savefig(data, format=suffix[1:], dpi=_DPI, metadata=_UNDATED[suffix])
    return data.getvalue()


def page(title: str, figure: Figure, text: str, view: str) -> bytes:
    """A page of HTML, all in itself: the view, the figure as SVG, and a report's text below them."""
    svg = render(figure, ".svg").decode()
    picture = re.sub(r"<metadata>.*?</metadata>", "", svg[svg.index("<svg") :], flags=re.DOTALL)
    page = _PAGE.format(title=html.escape(title), view=view, picture=picture, text=html.escape(text))
    return page.encode()
