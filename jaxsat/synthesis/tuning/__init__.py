"""Gain tuning: gradient descent through the simulator, and the proof of what it found."""
