/* Flies a recording: run_controller FILE [DIFFERENCE]. Each line of FILE has the inputs of a sample
   and the commands that are expected, in the order of its first line. The controller begins with
   the first one. Writes the commands, and fails if one differs by more than DIFFERENCE (0). */
#include "controller_records.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define NUMBERS (CONTROLLER_INPUT_SIZE + CONTROLLER_OUTPUT_SIZE)
#define LONGEST (32 * NUMBERS + 2)

/* Reads a line of numbers between commas; false at the end of the file. */
static bool read_line(FILE *file, double row[NUMBERS])
{
  static char line[LONGEST];
  char *rest = line;

  if (fgets(line, LONGEST, file) == NULL) {
    return false;
  }
  for (int i = 0; i < NUMBERS; i++) {
    char *end;
    row[i] = strtod(rest, &end);
    if ((end == rest) || (*end != ((i < NUMBERS - 1) ? ',' : '\n'))) {
      fprintf(stderr, "must be %d numbers and commas: %s", NUMBERS, line);
      exit(2);
    }
    rest = end + 1;
  }
  return true;
}

/* Writes numbers as a line; the number of those that differ from what is expected. */
static long written(const double *numbers, const double *expected, double allowed)
{
  long wrong = 0;

  for (int i = 0; i < CONTROLLER_OUTPUT_SIZE; i++) {
    const bool same = (numbers[i] == expected[i]) || (isnan(numbers[i]) && isnan(expected[i]));
    printf("%.17g%s", numbers[i], (i < CONTROLLER_OUTPUT_SIZE - 1) ? "," : "\n");
    if (!same && !(fabs(numbers[i] - expected[i]) <= allowed)) {
      wrong++;
    }
  }
  return wrong;
}

int main(int count, char **words)
{
  const double allowed = (count > 2) ? atof(words[2]) : 0.0;
  FILE *file = (count > 1) ? fopen(words[1], "r") : NULL;
  double row[NUMBERS];
  double commands[CONTROLLER_OUTPUT_SIZE];
  controller_input in;
  controller_state state;
  controller_output out;
  long samples = 0;
  long wrong = 0;
  int letter;

  if (file == NULL) {
    fprintf(stderr, "run_controller FILE [DIFFERENCE]: must be given a file that can be read\n");
    return 2;
  }
  do { /* the names of the numbers */
    letter = fgetc(file);
  } while ((letter != '\n') && (letter != EOF));
  while (read_line(file, row)) {
    read_controller_input(row, &in);
    if (samples == 0) {
      controller_init(&controller_default_parameters, @ATTITUDE@&in, &state);
    }
    controller_step(&controller_default_parameters, &in, &state, &out);
    write_controller_output(&out, commands);
    wrong += written(commands, row + CONTROLLER_INPUT_SIZE, allowed);
    samples++;
  }
  fclose(file);
  fprintf(stderr, "%ld samples, %ld commands differ\n", samples, wrong);
  return ((samples > 0) && (wrong == 0)) ? 0 : 1;
}
