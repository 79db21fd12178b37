"""An effector of a body by its class, for tests of that class."""


def effector_of(body, kind):
    """The body's effector of this class."""
    return next(one for one in body.effectors if isinstance(one, kind))
