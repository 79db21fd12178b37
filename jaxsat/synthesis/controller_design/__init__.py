"""From a vehicle with failures to a controller that is verified on it: `design`.

Nothing is imported here: who asks for the verdict on a vehicle needs none of the rest.
"""
