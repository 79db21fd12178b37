"""Laws compared on one set of cases: for two torques and a free third rate, or in any scenario."""
