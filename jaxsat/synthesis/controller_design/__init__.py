"""Controller design: from a vehicle with failures to a verified controller.

Nothing is imported here, so that the verdict on a vehicle loads none of the rest.
"""
