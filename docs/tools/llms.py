"""An index of the pages for language models: `llms.txt` (https://llmstxt.org)."""

from pathlib import Path

from docutils import nodes


def write(app, exception) -> None:
    """Write the index beside the pages that Sphinx has built."""
    if exception is None and app.builder.format == "html":
        Path(app.outdir, "llms.txt").write_text(index(app), encoding="utf-8")


def index(app) -> str:
    """Markdown: about the project, then title, source and first paragraph of each page in order."""
    env = app.env
    pages = [page for part in env.toctree_includes.get("index", ()) for page in _below(env, part)]
    lines = []
    for page in pages:
        link = f"[{env.titles[page].astext()}]({_source(app, page)})"
        lines.append(f"- {link}: {_about(env, page)}")
    head = [f"# {env.titles['index'].astext()}", f"> {_about(env, 'index')}"]
    return "\n\n".join([*head, "## Pages", "\n".join(lines)]) + "\n"


def _below(env, page):
    yield page
    for part in env.toctree_includes.get(page, ()):
        yield from _below(env, part)


def _source(app, page):
    """The page as it was written, which Sphinx copies, or the page itself."""
    suffix = Path(app.env.doc2path(page)).suffix
    return f"_sources/{page}.md.txt" if suffix == ".md" else f"{page}.html"


def _about(env, page):
    doctree = env.get_doctree(page)
    first = next(iter(doctree.findall(nodes.paragraph)), None)
    return "" if first is None else " ".join(first.astext().split())
