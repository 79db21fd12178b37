"""Flywheels: wheels without friction, which fail in two ways."""
