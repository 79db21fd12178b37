"""The least margin of a requirement that dispersions can bring about."""
