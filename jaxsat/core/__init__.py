"""Numbers, attitude, noise, checks and errors: what every other room is made of."""
