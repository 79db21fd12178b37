"""`jaxsat completion`: commands and options by the Tab key of a shell."""

from typing import Literal

from jaxsat.cli.options import Printed
from jaxsat.cli.terminal import SUCCESS, print_text


def completion(shell: Literal["bash", "zsh", "fish"], /, *, printed: Printed = Printed()) -> int:
    """Print what makes the Tab key of a shell complete commands and options.

    For bash, in ~/.bashrc: source <(jaxsat completion bash)

    Parameters
    ----------
    shell
        Which shell; zsh reads it from a file _jaxsat in its fpath, fish by
        jaxsat completion fish | source.
    """
    del printed  # `run` reads it
    from jaxsat.cli.app import app

    print_text(app.generate_completion(shell=shell))
    return SUCCESS
