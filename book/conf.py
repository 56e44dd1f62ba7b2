"""Settings of Sphinx: those of ``_config.yml``, as Jupyter Book reads them."""

from pathlib import Path

from jupyter_book.config import get_final_config

_book = Path(__file__).parent
_cli = {"latex_individualpages": False}
_settings, _ = get_final_config(
    user_yaml=_book.parent / "_config.yml", sourcedir=_book, cli_config=_cli
)
globals().update(_settings)


def setup(app):
    """Let Sphinx read pages in parallel: the extension that does not declare it runs afterwards."""
    app.extensions["sphinx_multitoc_numbering"].parallel_read_safe = True
