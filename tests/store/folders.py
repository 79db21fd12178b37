"""Output folders made in one line, and what is in them."""

from pathlib import Path

from jaxsat.store.folder import OutputFolder


def write(target, content="new", **options):
    with OutputFolder(target, **options) as folder:
        (folder.path / "data.txt").write_text(content)


def names(path):
    return sorted(entry.name for entry in Path(path).iterdir())
