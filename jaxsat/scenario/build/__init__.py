"""Construction of the core's objects from a scenario: closed loop, engine, study, tuning."""
