"""The compiled engine: programs for one trajectory as vector code, a lane for each."""
