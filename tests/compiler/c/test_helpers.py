"""Helpers of C for operations of whole numbers."""

import math
import subprocess

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.compiler.c.helpers import helper

KIND = np.dtype(np.int8)

MAIN = r"""
#include <stdint.h>
#include <stdio.h>
#include <string.h>
@HELPERS@
int main(void)
{
  for (int x = -128; x < 128; x++) {
    for (int y = -128; y < 128; y++) {
      printf("%d\n", (int)@NAME@((int8_t)x, (int8_t)y));
    }
  }
  return 0;
}
"""


def _texts(name, dtype):
    _, text, needed = helper(name, dtype)
    return [*(one for need in needed for one in _texts(*need[:2])), text]


def _expected(name, x, y):
    """Towards zero; by zero, zero; 128 is -128 in a byte."""
    if y == 0:
        return 0
    quotient = math.trunc(x / y)
    return (quotient + 128) % 256 - 128 if name == "quotient" else x - quotient * y


@needs("gcc")
@pytest.mark.parametrize("name", ["quotient", "remainder"])
def test_whole_numbers_are_divided_by_any_number(tmp_path, name):
    """All bytes by all bytes, without undefined behaviour."""
    helpers = "\n".join(_texts(name, KIND))
    text = MAIN.replace("@HELPERS@", helpers).replace("@NAME@", helper(name, KIND)[0])
    (tmp_path / "main.c").write_text(text)
    words = "gcc -std=c99 -Wall -Wextra -Wconversion -pedantic -Werror -fsanitize=undefined"
    command = [*words.split(), "-fno-sanitize-recover", "main.c", "-o", "main"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    run = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    numbers = range(-128, 128)
    assert list(map(int, run.stdout.split())) == [_expected(name, x, y) for x in numbers
                                                  for y in numbers]  # fmt: skip
