"""Files that are the same for every controller."""

BUILT = frozenset(f"build/{name}" for name in (
    "controller.o", "controller_guard.o", "controller_parameters.o",
    "test_controller", "libcontroller.so", "test_sanitized",
    "cortex-m4-steps.elf", "cortex-m4-test.elf", "cortex-m7-steps.elf", "cortex-m7-test.elf",
    "libflight_controller.a", "CMakeCache.txt", "cmake_install.cmake",
    "CTestTestfile.cmake", "Makefile",
)) | {"build"}  # fmt: skip
"""What `make` and CMake leave in the folder."""

OF_CMAKE = ("build/CMakeFiles", "build/Testing")
"""Folders of which all is CMake's own."""


def is_built(name: str) -> bool:
    """Whether the build files make this of an export; names are relative to its folder."""
    return name in BUILT or any(name == one or name.startswith(f"{one}/") for one in OF_CMAKE)


MAKEFILE = """\
# make              builds build/test_controller and build/libcontroller.so
# make test         compares the controller with its test vectors
# make sanitize     the same under the sanitizers for undefined behaviour and addresses
# make cppcheck     static analysis with the MISRA add-on
# make cortex-m     the same test and the instructions of a step on an emulated Cortex-M4F and M7
CC ?= cc
CFLAGS ?= -O2
STRICT = -std=c99 -Wall -Wextra -Wconversion -pedantic -Werror -ffp-contract=off
ULP ?= @ULP@
ARM = arm-none-eabi-gcc $(PROCESSOR) -mthumb -mfloat-abi=hard -O2 $(STRICT) \\
\t--specs=rdimon.specs -Wl,--section-start=.vectors=0x0
QEMU = qemu-system-arm -M $(BOARD) -nographic
SOURCES = controller.h controller_records.h
SHA256 = $(shell cat controller.h controller.c | { sha256sum 2>/dev/null || shasum -a 256; } \\
\t| cut -c 1-64)

.PHONY: all test sanitize cppcheck cortex-m cortex-m4 cortex-m7 clean
all: build/test_controller build/controller_guard.o build/controller_parameters.o \\
\tbuild/libcontroller.so

build:
\tmkdir -p build

build/controller.o: controller.c controller.h | build
\t$(CC) $(CFLAGS) $(STRICT) -c controller.c -o $@

build/controller_guard.o: controller_guard.c controller_guard.h controller.h | build
\t$(CC) $(CFLAGS) $(STRICT) -c controller_guard.c -o $@

build/controller_parameters.o: controller_parameters.c controller_parameters.h controller.h | build
\t$(CC) $(CFLAGS) $(STRICT) -c controller_parameters.c -o $@

build/test_controller: build/controller.o test_controller.c $(SOURCES)
\t$(CC) $(CFLAGS) $(STRICT) test_controller.c build/controller.o -o $@ -lm

build/libcontroller.so: controller.c controller_library.c $(SOURCES) | build
\t$(CC) $(CFLAGS) $(STRICT) -fPIC -shared -DCONTROLLER_SHA256='"$(SHA256)"' \\
\t\tcontroller_library.c -o $@ -lm

test: build/test_controller
\t./build/test_controller test_vectors.bin $(ULP)

sanitize: | build
\t$(CC) -O1 -g $(STRICT) -fsanitize=undefined,address -fno-sanitize-recover=all \\
\t\tcontroller.c test_controller.c -o build/test_sanitized -lm
\t./build/test_sanitized test_vectors.bin $(ULP)

cppcheck:
\tcppcheck --quiet --std=c99 --enable=warning,portability,performance --error-exitcode=1 \\
\t\t--addon=misra --suppressions-list=misra_deviations.txt \\
\t\tcontroller.c controller_guard.c controller_parameters.c

cortex-m: cortex-m4 cortex-m7
cortex-m4: PROCESSOR = -mcpu=cortex-m4 -mfpu=fpv4-sp-d16
cortex-m4: BOARD = mps2-an386
cortex-m7: PROCESSOR = -mcpu=cortex-m7 -mfpu=fpv5-d16
cortex-m7: BOARD = mps2-an500
cortex-m4 cortex-m7: | build
\t$(ARM) cortex_m.c controller.c -DSTEPS -o build/$@-steps.elf -lm
\t$(QEMU) -icount shift=0 -semihosting-config enable=on,target=native \\
\t\t-kernel build/$@-steps.elf
\t$(ARM) cortex_m.c controller.c test_controller.c -o build/$@-test.elf -lm
\t$(QEMU) -semihosting-config enable=on,target=native,arg=test,arg=test_vectors.bin,arg=$(ULP) \\
\t\t-kernel build/$@-test.elf

clean:
\trm -rf build
"""

CMAKE = """\
cmake_minimum_required(VERSION 3.13)
project(controller C)
set(CMAKE_C_STANDARD 99)
set(CMAKE_C_EXTENSIONS OFF)
add_compile_options(-Wall -Wextra -Wconversion -pedantic -Werror -ffp-contract=off)

add_library(flight_controller STATIC
            controller.c controller_guard.c controller_parameters.c)
target_include_directories(flight_controller PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(flight_controller m)

add_library(controller MODULE controller_library.c)
target_link_libraries(controller m)
file(READ controller.h header)
file(READ controller.c source)
string(SHA256 digest "${header}${source}")
target_compile_definitions(controller PRIVATE "CONTROLLER_SHA256=\\"${digest}\\"")
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS controller.h controller.c)

add_executable(test_controller test_controller.c)
target_link_libraries(test_controller flight_controller)

enable_testing()
add_test(NAME vectors
         COMMAND test_controller ${CMAKE_CURRENT_SOURCE_DIR}/test_vectors.bin @ULP@)
"""

CORTEX_M = """\
/* Start-up code for an emulated Cortex-M4F (mps2-an386) or Cortex-M7 (mps2-an500), and how many
   instructions a step takes. */
#include "controller_records.h"

#include <stdio.h>

extern void _start(void);

/* Access to coprocessors: 10 and 11 are the floating-point unit, off after a reset. */
#define COPROCESSOR_ACCESS (*(volatile uint32_t *)0xE000ED88u)

static void reset(void)
{
  COPROCESSOR_ACCESS |= 0xFu << 20;
  __asm__ volatile("dsb\\n\\tisb");
  _start();
}

/* Address of the end of the stack, then of the first function. */
__attribute__((section(".vectors"), used)) static void (*const vectors[2])(void) = {
  (void (*)(void))0x20400000, reset
};

#ifdef STEPS
#define TIMER_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define TIMER_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define TIMER_VALUE (*(volatile uint32_t *)0xE000E018u)

/* The timer counts at 25 MHz; with -icount shift=0 an instruction takes one nanosecond. */
#define INSTRUCTIONS_PER_TICK (40u)
#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)

static controller_input in;
static controller_state state;
static controller_output out;
static double head[4];
static double row[GIVEN + EXPECTED];

/* Runs every sample of the test vectors. */
int main(void)
{
  uint32_t most = 0u;
  FILE *file = fopen("test_vectors.bin", "rb");
  if ((file == NULL) || (fread(head, sizeof(double), 4, file) != 4)) {
    return 2;
  }
  TIMER_RELOAD = 0xFFFFFFu;
  TIMER_VALUE = 0u;
  TIMER_CONTROL = 5u;
  for (long sample = 0; sample < (long)head[1]; sample++) {
    if (fread(row, sizeof(double), GIVEN + EXPECTED, file) != GIVEN + EXPECTED) {
      return 2;
    }
    read_controller_input(row, &in);
    read_controller_state(row + CONTROLLER_INPUT_SIZE, &state);
    const uint32_t before = TIMER_VALUE;
    controller_step(&controller_default_parameters, &in, &state, &out);
    const uint32_t ticks = (before - TIMER_VALUE) & 0xFFFFFFu;
    if (ticks > most) {
      most = ticks;
    }
  }
  fclose(file);
  printf("%lu instructions a step at most\\n", (unsigned long)(most * INSTRUCTIONS_PER_TICK));
  return 0;
}
#endif
"""

BLOCKS = """\
/* For every sample, how many blocks of code its step runs, and whether any ran in none before. */
#include "controller_records.h"

#include <stdio.h>

#define GIVEN (CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE)
#define EXPECTED (CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE)
#define PLACES (1u << 20)

void __sanitizer_cov_trace_pc(void);

static uintptr_t seen[PLACES];
static unsigned long blocks;
static int is_new;

/* The compiler calls it at the beginning of every block of controller.c. */
void __sanitizer_cov_trace_pc(void)
{
  const uintptr_t here = (uintptr_t)__builtin_return_address(0);
  uintptr_t place = here % PLACES;
  while ((seen[place] != 0u) && (seen[place] != here)) {
    place = (place + 1u) % PLACES;
  }
  is_new |= (seen[place] == 0u);
  seen[place] = here;
  blocks++;
}

int main(void)
{
  static controller_input in;
  static controller_state state;
  static controller_output out;
  static double row[GIVEN + EXPECTED];
  double head[4];
  FILE *file = fopen("test_vectors.bin", "rb");
  if ((file == NULL) || (fread(head, sizeof(double), 4, file) != 4)) {
    return 2;
  }
  for (long sample = 0; sample < (long)head[1]; sample++) {
    if (fread(row, sizeof(double), GIVEN + EXPECTED, file) != GIVEN + EXPECTED) {
      return 2;
    }
    read_controller_input(row, &in);
    read_controller_state(row + CONTROLLER_INPUT_SIZE, &state);
    blocks = 0;
    is_new = 0;
    controller_step(&controller_default_parameters, &in, &state, &out);
    printf("%lu %d\\n", blocks, is_new);
  }
  return 0;
}
"""
"""A program of the exporting machine, which finds the samples that are worth emulating."""

DEVIATIONS = {
    "misra-c2012-2.5": "macros of modes are for callers",
    "misra-c2012-5.9": "names are unique in a file, and Python's names recur",
    "misra-c2012-7.2": "constants of UINT64_C, whose suffix the checker does not see",
    "misra-c2012-8.7": "the interface is for other files",
    "misra-c2012-8.9": "tables stand before the functions that read them",
    "misra-c2012-9.3": "a copy of a whole struct, which the checker takes for a list of elements",
    "misra-c2012-10.4": "selections of one type, which the checker takes for mixed",
    "misra-c2012-12.1": "the precedence of * over + is relied on, as in any formula",
    "misra-c2012-12.3": "declarations of several variables, whose commas the checker takes for the "
    "operator",
    "misra-c2012-15.4": "a bounded loop with a condition of its own ends by break",
    "misra-c2012-15.5": "small helpers return where they know the result",
    "misra-c2012-17.3": "functions of math.h are declared there, which the checker does not read",
    "misra-c2012-17.7": "casts to pointers to rows, which the checker takes for calls",
    "misra-c2012-21.15": "bits of a number are copied with memcpy, between types of one size",
    "missingIncludeSystem": "headers of the C library",
    "unusedStructMember": "fields that the law reads in part",
}
"""Rules that are not followed, and why."""
