"""From a scenario to the objects of the core: closed loop, engine, study, tuning."""
