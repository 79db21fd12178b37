"""One self-contained HTML file of results: plots, 3-D replay, tables and provenance.

Needs the packages of the extra `report` (Bokeh, Jinja2), which are imported when a page is made.
"""

from jaxsat.report.page.html import MissingPackages, report_page, require_packages

__all__ = ["MissingPackages", "report_page", "require_packages"]
