"""Errors of the options' parser in the form of every message: "OPTION: must …, got …"."""

from collections.abc import Iterable, Iterator
from typing import Literal, get_args, get_origin

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownOptionError,
    UnusedCliTokensError,
)
from cyclopts.exceptions import UnknownCommandError

from jaxsat.cli.options import MAX_VALUE_LENGTH
from jaxsat.core.text import clean, suggestion

CLOSE = 0.75
"""Similarity from which a word is a misspelt one: --sett for --set, not --seed."""


def parser_message(error: CycloptsError, app: App) -> str:
    """Return the message for wrong words after `jaxsat`, with a pointer to the options."""
    command = " ".join(("jaxsat", *(error.command_chain or ())))
    match error:
        case UnusedCliTokensError():
            message = f"`{command}`: must be given without {_unused(error)}"
        case MissingArgumentError():
            message = _missing(error, command, app)
        case RepeatArgumentError():
            message = f"{error.token.keyword}: must be given once, got it again"
        case CoercionError() if error.token is not None and error.argument is not None:
            message = _unfit(error, error.token.keyword or error.argument.name, error.token.value)
        case UnknownOptionError():
            word = (error.token.keyword or error.token.value).partition("=")[0]
            names = (name for one in error.argument_collection if one.parse for name in one.names)
            message = _unknown_option(word, command, names, app)
        case UnknownCommandError():
            message = _unknown_command(error, command)
        case _:
            message = str(error)
    return f"{message}\nsee `{command} --help`"


def _missing(error: MissingArgumentError, command: str, app: App) -> str:
    assert error.argument is not None
    name, words = error.argument.name, error.unused_tokens or ()
    misspelt = [word for word in words if suggestion(word.partition("=")[0], [name], CLOSE)]
    if misspelt and error.keyword is None:
        word = clean(misspelt[0], MAX_VALUE_LENGTH)
        return f"{word}: must be an option of `{command}`, did you mean {name}?"
    choices = _choices(error.argument.hint)
    what = f"one of {', '.join(choices)}" if choices else _meaning(name, command, app)
    rule = "must be given" if error.keyword is None else "must be given with a value"
    return f"{error.keyword or name}: {rule}{what and f' ({what})'}, got nothing"


def _meaning(name: str, command: str, app: App) -> str:
    """Return the first sentence of the help of a command's argument, "" without help."""
    for word in command.split()[1:]:
        app = app[word]
    for argument in app.assemble_argument_collection(parse_docstring=True):
        if argument.name == name:
            sentence = " ".join((argument.parameter.help or "").split()).split(". ")[0]
            return sentence.rstrip(".")
    return ""


def _unused(error: UnusedCliTokensError) -> str:
    extra = " ".join(error.unused_tokens or ())
    takes_overrides = "overrides" in getattr(error.target, "__annotations__", {})
    is_override = takes_overrides and "=" in extra
    return f"{extra}{' (each KEY=VALUE follows a --set of its own)' if is_override else ''}"


def _unfit(error: CoercionError, name: str, value: str) -> str:
    value = clean(value, MAX_VALUE_LENGTH) or "nothing"
    choices = _choices(error.target_type)
    if choices:
        hint = suggestion(value, choices, CLOSE)
        return f"{name}: must be one of {', '.join(choices)}, got {value}{hint}"
    if error.target_type is bool:
        return f"{name}: must be given without a value, got {value}"
    return str(error)


def _unknown_option(word: str, command: str, names: Iterable[str], app: App) -> str:
    others = [other for other in _commands_with(word, app) if f"jaxsat {other}" != command]
    hint = f" (it is one of {', '.join(others)})" if others else suggestion(word, names, CLOSE)
    return f"{clean(word, MAX_VALUE_LENGTH)}: must be an option of `{command}`{hint}"


def _commands_with(option: str, app: App) -> Iterator[str]:
    for name in _shown(app):
        if app[name].default_command is not None:
            arguments = app[name].assemble_argument_collection()
            if any(option in one.names for one in arguments if one.parse):
                yield name


def _unknown_command(error: UnknownCommandError, command: str) -> str:
    word, names = (error.unused_tokens or [""])[0], [] if error.app is None else _shown(error.app)
    if word.startswith("-"):
        return f"{clean(word, MAX_VALUE_LENGTH)}: must follow a command ({', '.join(names)})"
    word = clean(word, MAX_VALUE_LENGTH) or "nothing"
    hint = suggestion(word, names, CLOSE)
    return f"`{command}`: must be given with a command ({', '.join(names)}), got {word}{hint}"


def _shown(app: App) -> list[str]:
    return [name for name in app if not name.startswith("-")]


def _choices(kind: object) -> list[str]:
    """Return the allowed words of an option, in a list too; empty if it is not a choice."""
    if get_origin(kind) is tuple:
        kind = get_args(kind)[0]
    return [str(one) for one in get_args(kind)] if get_origin(kind) is Literal else []
