"""What makes a scalar program smaller and quicker."""
