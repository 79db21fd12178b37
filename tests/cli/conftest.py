"""The command line, run in this process in a folder of its own."""

import pytest

# jaxsat is imported in fixtures: pytest reads this file before types are checked.


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    from jaxsat.cli import progress

    monkeypatch.chdir(tmp_path)
    # What is told depends on the machine.
    monkeypatch.setattr(progress, "FIRST_DELAYS_S", (1e9, 1e9))


@pytest.fixture
def command_line(capsys):
    """Run the command line here; gives exit status, standard output and standard error."""
    from jaxsat.cli import main

    def run(*tokens):
        with pytest.raises(SystemExit) as caught:
            main(list(tokens))
        output = capsys.readouterr()
        return caught.value.code, output.out, output.err

    return run
