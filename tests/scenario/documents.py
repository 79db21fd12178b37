"""What is in a TOML document."""


def every_location(value, path=()):
    if path:
        yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries if isinstance(value, dict | list) else ():
        if isinstance(entry, dict | list):
            yield from every_location(entry, (*path, key))
        else:
            yield (*path, key)
