"""How good control can get: least time and least effort of a manoeuvre, found open loop."""
