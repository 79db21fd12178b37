"""Open-loop optima: least time and least effort of a manoeuvre."""
