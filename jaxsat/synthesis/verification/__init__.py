"""Requirements verified in the nominal run, over dispersed cases, and with actuators that fail."""
