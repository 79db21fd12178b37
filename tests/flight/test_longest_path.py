"""The script of an export that bounds instructions: small programs whose counts are known."""

import importlib
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from helpers.tools import needs


@pytest.fixture(scope="module")
def script():
    """The script as a module, beside its own modules."""
    place = str(files("jaxsat.flight") / "assets")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(place)
        return importlib.import_module("longest_path")


BEYOND = ("moved", "beyond", "varied", "either", "after", "other_flags")
"""Functions with a loop like that of a copy that may turn more often."""

CODE = """\
#include <math.h>
#include <stdint.h>
#include <string.h>
typedef struct { int32_t all[25]; } record;
volatile int32_t port;
record one, other;
void seen(record *all) __attribute__((noinline));
double saved(double x, double y) __attribute__((noinline));
double outer(double x);
void grows(int32_t x);
void straight(void);
void choose(int32_t x);
void repeat(void);
void nested(void);
void stop(int32_t x);
void enter(int32_t x);
void copy(void);
void endless(int32_t x);
void spin(void);
void recur(int32_t x);
void point(void (*f)(void));
double rest(double x, double y);
void joined(void) __attribute__((naked));
void unknown(void) __attribute__((naked));
void block(void) __attribute__((naked));
void earlier(void) __attribute__((naked));
void shifted(void) __attribute__((naked));
void moved(void) __attribute__((naked));
void beyond(void) __attribute__((naked));
void varied(void) __attribute__((naked));
void either(void) __attribute__((naked));
void after(void) __attribute__((naked));
void other_flags(void) __attribute__((naked));
static void times(int32_t count) __attribute__((noinline));
static void times(int32_t count)
{
  for (int32_t i = 1; i < count; i++) {
    port = 1;
  }
}
void straight(void) { port = 1; port = 2; port = 3; }
void choose(int32_t x)
{
  if (x > 0) {
    port = 1; port = 2; port = 3; port = 4; port = 5; port = 6;
  } else {
    port = 7;
  }
}
void repeat(void) { times(300); times(7); }
void nested(void)
{
  for (int32_t i = 0; i < 30; i++) {
    for (int32_t j = 2; j < 42; j++) {
      port = j;
    }
  }
}
void stop(int32_t x)
{
  int32_t k = 0;
  for (; k < 24; k++) {
    if (port == x) {
      break;
    }
  }
  port = k;
}
void enter(int32_t x)
{
  int32_t j = 0;
  if (x > 0) {
    goto inside;
  }
  for (; j < 20; j++) {
    port = x;
    x = port;
  inside:
    port = j;
  }
}
void seen(record *all) { port = all->all[port]; }
void copy(void)
{
  record all = one;
  seen(&all);
  other = all;
  one = all;
}
double saved(double x, double y)
{
  record all;
  all.all[3] = port;
  seen(&all);
  const double z = x * y;
  seen(&all);
  return z * x + y + all.all[3];
}
double outer(double x) { return x * saved(x, x); }
void grows(int32_t x)
{
  int32_t all[x];
  seen((record *)all);
}
void endless(int32_t x) { while (port != x) { port = x; } }
void spin(void) { for (;;) { } }
void recur(int32_t x) { if (port > x) { recur(x + 1); port = x; } }
void point(void (*f)(void)) { f(); port = 1; }
double rest(double x, double y) { return fmod(x, y) + 1; }
void joined(void)
{
  __asm__("push {r3, lr}; movs r2, #100; cmp r0, #0; beq 1f; movs r2, #24");
  __asm__("1: bl memcpy; pop {r3, pc}");
}
void unknown(void)
{
  __asm__("push {r3, lr}; movs r2, #24; cmp r0, #0; beq 1f; ldmia r0, {r0, r1, r2}");
  __asm__("1: bl memcpy; pop {r3, pc}");
}
void block(void)
{
  __asm__("add.w r1, r0, #48");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void earlier(void)
{
  __asm__("add.w r1, r0, #48; cmp r2, #0; beq 1f; movs r2, #7");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void shifted(void)
{
  __asm__("add.w r1, r0, #88; movs r2, #7; add.w r0, r0, #40");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void moved(void)
{
  __asm__("add.w r1, r0, #48; adds r0, #4");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void beyond(void)
{
  __asm__("add.w r1, r0, #50");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void varied(void)
{
  __asm__("add.w r1, r0, #48");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, r2; cmp r0, r1; bne 1b; bx lr");
}
void either(void)
{
  __asm__("add.w r1, r0, #48; cmp r2, #0; beq 1f; mov r1, r3");
  __asm__("1: ldr r2, [r0]; add.w r0, r0, #16; cmp r0, r1; bne 1b; bx lr");
}
void after(void)
{
  __asm__("add.w r1, r0, #48");
  __asm__("1: ldr r2, [r0]; cmp r0, r1; add.w r0, r0, #16; bne 1b; bx lr");
}
void other_flags(void)
{
  __asm__("add.w r1, r0, #48");
  __asm__("1: add.w r0, r0, #16; cmp r0, r1; adds r2, r2, #1; bne 1b; bx lr");
}
int main(void) { return 0; }
"""


@pytest.fixture(scope="module")
def program(script, tmp_path_factory):
    folder = tmp_path_factory.mktemp("program")
    (folder / "code.c").write_text(CODE)
    command = "arm-none-eabi-gcc -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16 -O2 -g"
    command += " --specs=nosys.specs -w -fstack-usage"
    command += " code.c -o code.elf -lm"
    subprocess.run(command.split(), cwd=folder, check=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield script.Program("code.elf")


def _length(program, name: str) -> int:
    """Instructions of a function's text, each once."""
    return sum(program.code.name(address) == name for address in program.code.rows)


@needs("arm-none-eabi-gcc")
def test_the_bound_is_that_of_the_longest_path(program):
    names = "straight", "choose", "repeat", "nested", "stop", "enter", "copy", "joined"
    bound = {name: program.bound(program.code.starts[name]) for name in names}
    assert bound["straight"] == _length(program, "straight")
    # a comparison, a branch, six numbers, six stores and a return, without the shorter branch
    assert 15 <= bound["choose"] < _length(program, "choose")
    # a store, the count and a branch, 299 times in each of two calls
    assert 2 * 3 * 299 < bound["repeat"] < 2 * 5 * 300 + 20
    # a store, the count and two more, 40 times 30 times
    assert 3 * 40 * 30 < bound["nested"] < 5 * 41 * 31 + 20
    # a load, a comparison with a branch, the count, and another comparison with a branch
    assert 6 * 24 <= bound["stop"] < 8 * 25 + 20
    # two stores, a load, the count, a comparison and a branch, entered at two places
    assert 6 * 20 <= bound["enter"] < 2 * 8 * 22 + 20
    # three copies of 25 words, which may be of 100 bytes one by one
    assert 3 * 2 * 25 < bound["copy"] < 3 * 8 * 100
    # a copy of 100 bytes, or of 24
    assert bound["joined"] == 6 + 1 + program.bound(program.code.starts["memcpy"], 100)
    # three passes of four instructions each over 48 bytes
    assert program.bound(program.code.starts["block"]) == 1 + 3 * 4 + 1
    assert program.bound(program.code.starts["earlier"]) == 4 + 3 * 4 + 1
    assert program.bound(program.code.starts["shifted"]) == 3 + 3 * 4 + 1


@needs("arm-none-eabi-gcc")
def test_the_stack_is_that_of_the_compiler_along_the_deepest_chain(script, program):
    """By the compiler's own figures for each function (-fstack-usage)."""
    (file,) = Path().glob("*.su")
    rows = (line.split("\t") for line in file.read_text().splitlines())
    frames = {row[0].split(":")[-1]: int(row[1]) for row in rows}
    assert frames["saved"] >= 100 + 8 + 4  # an array, and registers of both kinds
    stack = {name: program.stack(program.code.starts[name]) for name in ("seen", "outer", "saved")}
    assert stack["seen"] == frames["seen"]
    assert stack["saved"] == frames["saved"] + frames["seen"]
    assert stack["outer"] == frames["outer"] + stack["saved"]
    with pytest.raises(script.Unbounded, match="grows reserves stack by a number"):
        program.stack(program.code.starts["grows"])


@needs("arm-none-eabi-gcc")
@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("endless", "endless has a loop without a bound"),
        ("spin", "spin has a loop without a bound"),
        ("recur", "recur calls itself"),
        ("point", "point calls by a pointer"),
        ("rest", "fmod has a loop and no debug information"),
        ("unknown", "unknown copies an unknown number of bytes"),
        *((name, "has a loop without") for name in BEYOND),
    ],
)
def test_what_cannot_be_bounded_is_told(script, program, name, why):
    with pytest.raises(script.Unbounded, match=why):
        program.bound(program.code.starts[name])


def test_loops_run_as_often_as_their_text_says(script):
    """The begin of a loop may be an assignment before it, and the end what calls give."""
    bounds = script.loop_bounds(CODE)
    lines = CODE.splitlines()
    by_text = {lines[line - 1].strip(): most for line, most in bounds.items()}
    assert by_text == {
        "for (int32_t i = 1; i < count; i++) {": 299,
        "for (int32_t i = 0; i < 30; i++) {": 30,
        "for (int32_t j = 2; j < 42; j++) {": 40,
        "for (; k < 24; k++) {": 24,
        "for (; j < 20; j++) {": 20,
    }
    assert script.loop_bounds(CODE.replace("times(7)", "times(port)")).keys() < bounds.keys()
    assert script.loop_bounds(CODE.replace("k = 0;", "k = port;")).keys() < bounds.keys()


@pytest.mark.parametrize(
    ("starts", "most"),
    [
        ("k = UINT32_C(0);", 24),
        ("k = -INT64_C(100);", 124),
        ("k = 0; if (port > 1) { k = 20; }", 24),
        ("k = port;", None),
        ("k = 0; if (port > 1) { k = port; }", None),
    ],
)
def test_a_counter_begins_at_the_least_that_its_own_function_gives_it(script, starts, most):
    before = "void other(void)\n{\n  int32_t k = 20;\n}\n"
    loop = f"void own(void)\n{{\n  int32_t {starts}\n  for (; k < 24; k++) {{}}\n}}\n"
    assert list(script.loop_bounds(before + loop).values()) == [most][: most is not None]
