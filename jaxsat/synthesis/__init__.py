"""Better gains, the right law, the least time: tuning, comparison, bounds, controller design."""
