"""What a command says when it is interrupted."""

import pytest
import typer

from shared_control_env.evaluation.interrupt import resumable


def test_an_interrupt_ends_the_command_and_names_the_folder(tmp_path, capsys):
    with pytest.raises(typer.Exit) as ended, resumable(tmp_path):
        raise KeyboardInterrupt
    assert ended.value.exit_code == 130
    assert str(tmp_path) in capsys.readouterr().out


def test_anything_else_passes(tmp_path, capsys):
    with pytest.raises(ValueError, match="mine"), resumable(tmp_path):
        raise ValueError("mine")
    with resumable(tmp_path):
        pass
    assert capsys.readouterr().out == ""
