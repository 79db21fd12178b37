"""Pictures of results: datasets in, matplotlib figures out."""
