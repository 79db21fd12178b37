"""Reports of results: documents, and figures by matplotlib."""
