"""Gain tuning: gradient descent through the simulator, and its verification."""
