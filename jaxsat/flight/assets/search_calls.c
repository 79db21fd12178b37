/* Looks for calls of the controller that run branches which no call before ran.

   Calls that did, and those that came nearest to another outcome of a comparison, are changed at
   random, or where a number of theirs is one that was compared. controller.c is compiled so that it
   tells its blocks (-fsanitize-coverage=trace-pc) and comparisons (trace-cmp). */
#include "controller_calls.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLACES (1u << 18)
#define SITES (1u << 14)
#define SIDES (3)
#define EVENTS (1u << 15)
#define KEPT (4096u)

/* What a comparison has found so far: numbers below, above and equal, and the nearest misses. */
typedef struct {
  uintptr_t here;
  bool found[SIDES];
  double nearest[SIDES];
  double *row[SIDES];
} comparison;

typedef struct {
  comparison *site;
  double first;
  double second;
} event;

static uint64_t edges[PLACES];
static comparison sites[SITES];
static comparison *known[SITES];
static unsigned sites_known;
static event events[EVENTS];
static unsigned happened;
static uintptr_t before;
static uint64_t blocks;
static bool is_new;
static bool on;

void __sanitizer_cov_trace_pc(void);
void __sanitizer_cov_trace_cmpd(double first, double second);
void __sanitizer_cov_trace_cmpf(float first, float second);
void __sanitizer_cov_trace_cmp1(uint8_t first, uint8_t second);
void __sanitizer_cov_trace_cmp2(uint16_t first, uint16_t second);
void __sanitizer_cov_trace_cmp4(uint32_t first, uint32_t second);
void __sanitizer_cov_trace_cmp8(uint64_t first, uint64_t second);
void __sanitizer_cov_trace_const_cmp1(uint8_t first, uint8_t second);
void __sanitizer_cov_trace_const_cmp2(uint16_t first, uint16_t second);
void __sanitizer_cov_trace_const_cmp4(uint32_t first, uint32_t second);
void __sanitizer_cov_trace_const_cmp8(uint64_t first, uint64_t second);
void __sanitizer_cov_trace_switch(uint64_t value, void *cases);

/* The compiler calls it at the beginning of every block: pairs of blocks are branches. */
void __sanitizer_cov_trace_pc(void)
{
  const uintptr_t here = (uintptr_t)__builtin_return_address(0);
  const uint64_t edge = ((uint64_t)here * 0x9E3779B97F4A7C15u) ^ ((uint64_t)before * 31u);
  uint64_t place = (edge ^ (edge >> 29)) % PLACES;
  if (!on) {
    return;
  }
  blocks++;
  while ((edges[place] != 0u) && (edges[place] != edge)) {
    place = (place + 1u) % PLACES;
  }
  is_new = is_new || (edges[place] == 0u);
  edges[place] = edge;
  before = here;
}

static void compared(uintptr_t here, double first, double second)
{
  unsigned place = (unsigned)((here * 0x9E3779B97F4A7C15u) >> 40) % SITES;
  if (!on) {
    return;
  }
  while ((sites[place].here != 0u) && (sites[place].here != here)) {
    place = (place + 1u) % SITES;
  }
  if (sites[place].here == 0u) {
    sites[place].here = here;
    for (int side = 0; side < SIDES; side++) {
      sites[place].nearest[side] = HUGE_VAL;
    }
    known[sites_known++] = &sites[place];
  }
  if (happened < EVENTS) {
    events[happened++] = (event){&sites[place], first, second};
  }
}

#define HERE ((uintptr_t)__builtin_return_address(0))
void __sanitizer_cov_trace_cmpd(double a, double b) { compared(HERE, a, b); }
void __sanitizer_cov_trace_cmpf(float a, float b) { compared(HERE, a, b); }
void __sanitizer_cov_trace_cmp1(uint8_t a, uint8_t b) { compared(HERE, (int8_t)a, (int8_t)b); }
void __sanitizer_cov_trace_cmp2(uint16_t a, uint16_t b) { compared(HERE, (int16_t)a, (int16_t)b); }
void __sanitizer_cov_trace_cmp4(uint32_t a, uint32_t b) { compared(HERE, (int32_t)a, (int32_t)b); }
void __sanitizer_cov_trace_cmp8(uint64_t a, uint64_t b)
{
  compared(HERE, (double)(int64_t)a, (double)(int64_t)b);
}
void __sanitizer_cov_trace_const_cmp1(uint8_t a, uint8_t b) { compared(HERE, (int8_t)b, (int8_t)a); }
void __sanitizer_cov_trace_const_cmp2(uint16_t a, uint16_t b)
{
  compared(HERE, (int16_t)b, (int16_t)a);
}
void __sanitizer_cov_trace_const_cmp4(uint32_t a, uint32_t b)
{
  compared(HERE, (int32_t)b, (int32_t)a);
}
void __sanitizer_cov_trace_const_cmp8(uint64_t a, uint64_t b)
{
  compared(HERE, (double)(int64_t)b, (double)(int64_t)a);
}
void __sanitizer_cov_trace_switch(uint64_t value, void *cases) { (void)value; (void)cases; }

static uint64_t random_state = 0x9E3779B97F4A7C15u;

static uint64_t random_bits(void)
{
  random_state ^= random_state << 13;
  random_state ^= random_state >> 7;
  random_state ^= random_state << 17;
  return random_state;
}

static unsigned below(unsigned count)
{
  return (unsigned)((random_bits() >> 33) % count);
}

static double uniform(void)
{
  return (double)(random_bits() >> 11) * 0x1p-53;
}

static double kinds[CALL_SIZE];
static double least[CALL_SIZE];
static double most[CALL_SIZE];
static double *kept_rows[KEPT];
static unsigned kept_count;

static double *copied(const double *row)
{
  double *copy = malloc(sizeof(double) * CALL_SIZE);
  if (copy == NULL) {
    exit(3);
  }
  return memcpy(copy, row, sizeof(double) * CALL_SIZE);
}

static int side_of(double first, double second)
{
  return (first < second) ? 0 : ((first > second) ? 1 : ((first == second) ? 2 : -1));
}

/* Makes the call of a row, and tells whether it runs anything new. */
static bool tries(const double *row)
{
  static double found[CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE];
  bool news;
  happened = 0u;
  is_new = false;
  before = 0u;
  on = true;
  make_call(row, found);
  on = false;
  news = is_new;
  for (unsigned i = 0; i < happened; i++) {
    comparison *site = events[i].site;
    const int side = side_of(events[i].first, events[i].second);
    if ((side >= 0) && !site->found[side]) {
      site->found[side] = true;
      news = true;
    }
  }
  for (unsigned i = 0; i < happened; i++) {
    comparison *site = events[i].site;
    const double off = fabs(events[i].first - events[i].second);
    for (int side = 0; side < SIDES; side++) {
      if (!site->found[side] && (off < site->nearest[side])) {
        site->nearest[side] = off;
        if (site->row[side] == NULL) {
          site->row[side] = copied(row);
        } else {
          memcpy(site->row[side], row, sizeof(double) * CALL_SIZE);
        }
      }
    }
  }
  return news;
}

static void set(double *row, unsigned i, double value)
{
  if (kinds[i] == 1.0) {
    value = (value >= -2147483648.0 && value <= 2147483647.0) ? floor(value) : 0.0;
  } else if (kinds[i] == 2.0) {
    value = (value != 0.0) ? 1.0 : 0.0;
  } else if (kinds[i] == 3.0) {
    return;
  } else {
    value = (double)(CALL_REAL)value;
  }
  if (value < least[i]) {
    value = least[i];
  }
  if (value > most[i]) {
    value = most[i];
  }
  if (isnan(value) && (i <= CALL_PARAMETERS)) {
    return; /* no parameter is that */
  }
  row[i] = value;
}

#define SPECIAL (sizeof(special) / sizeof(special[0]))
static const double special[] = {
  0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 1e-12, 1e12, 1e300, -1e300, HUGE_VAL, -HUGE_VAL, NAN,
  3.141592653589793, 16384.0, 0.5, 2.0, 1048576.0, 5e-324, 1e-6, -1e-6, 1e-3, 1e3
};

static double some_number(double old)
{
  switch (below(8u)) {
  case 0:
    return special[below(SPECIAL)];
  case 1:
    return old * (2.0 * uniform());
  case 2:
    return -old;
  case 3:
    return old + (uniform() - 0.5) * 0.1;
  case 4:
    return old * pow(10.0, 8.0 * (uniform() - 0.5));
  case 5:
    return 2.0 * uniform() - 1.0;
  case 6:
    return (2.0 * uniform() - 1.0) * pow(10.0, 12.0 * uniform() - 8.0);
  default:
    return nextafter(old, (uniform() < 0.5) ? -HUGE_VAL : HUGE_VAL);
  }
}

/* The place of some number, seldom of a parameter, of which there may be many. */
static unsigned some_place(void)
{
  const unsigned others = CALL_SIZE - 1u - CALL_PARAMETERS;

  return (below(4u) == 0u) ? (1u + below(CALL_SIZE - 1u))
                           : (1u + CALL_PARAMETERS + below(others));
}

static void mutate(double *row, unsigned i)
{
  if (kinds[i] == 1.0) {
    const double options[] = {row[i] + 1.0, row[i] - 1.0, (double)below(8u), (double)below(100u) - 2.0};
    set(row, i, options[below(4u)]);
  } else if (kinds[i] == 2.0) {
    set(row, i, 1.0 - row[i]);
  } else if (below(6u) == 0u) {
    set(row, i, row[below(CALL_SIZE)]);
  } else {
    set(row, i, some_number(row[i]));
  }
}

/* Numbers of the row that stand in a comparison take the place of what they were compared with. */
static bool aim(double *row, comparison *site, int side)
{
  const event *nearest = NULL;
  unsigned places = 0u;
  unsigned chosen = 0u;
  double to = 0.0;
  for (unsigned i = 0; i < happened; i++) {
    if ((events[i].site == site) &&
        ((nearest == NULL) || (below(3u) == 0u))) {
      nearest = &events[i];
    }
  }
  if (nearest == NULL) {
    return false;
  }
  for (unsigned i = 0; i < CALL_SIZE; i++) {
    for (int which = 0; which < 2; which++) {
      const double mine = (which == 0) ? nearest->first : nearest->second;
      const double other = (which == 0) ? nearest->second : nearest->first;
      if ((fabs(row[i]) == fabs(mine)) && (kinds[i] != 3.0)) {
        places++;
        if (below(places) == 0u) {
          const double step = (below(2u) == 0u) ? 0.0 : (fabs(other) + 1e-9) * 0.3 * uniform();
          const bool up = (which == 0) == (side == 1);
          chosen = i;
          to = (side == 2) ? other : (up ? nextafter(other, HUGE_VAL) + step
                                         : nextafter(other, -HUGE_VAL) - step);
          to = (row[i] == mine) ? to : -to;
        }
      }
    }
  }
  if (places == 0u) {
    return false;
  }
  set(row, chosen, to);
  return true;
}

/* Changes a row in some places, in a span, or for a span of another row. */
static void change(double *row)
{
  const unsigned begin = some_place();
  const unsigned length = 1u + below(24u);
  const unsigned end = (begin + length < CALL_SIZE) ? (begin + length) : CALL_SIZE;
  const unsigned changes = 1u << below(4u);
  const double *other = kept_rows[below((kept_count < KEPT) ? kept_count : KEPT)];
  const double filling = special[below(SPECIAL)];
  const unsigned kind = below(8u);

  for (unsigned i = begin; (i < end) && (kind < 2u); i++) {
    set(row, i, (kind == 0u) ? other[i] : filling);
  }
  for (unsigned i = 0; i < changes; i++) {
    mutate(row, some_place());
  }
}

/* search SEEDS FOUND BLOCKS: writes the rows of calls that run something new, until so many blocks
   were run. */
int main(int count, char **words)
{
  static double row[CALL_SIZE];
  double head[2];
  FILE *seeds = (count == 4) ? fopen(words[1], "rb") : NULL;
  FILE *found = (count == 4) ? fopen(words[2], "wb") : NULL;
  const uint64_t most_blocks = (count == 4) ? (uint64_t)atof(words[3]) : 0u;
  if ((seeds == NULL) || (found == NULL) || (fread(head, 8, 2, seeds) != 2) ||
      (head[1] != CALL_SIZE) || (fread(kinds, 8, CALL_SIZE, seeds) != CALL_SIZE) ||
      (fread(least, 8, CALL_SIZE, seeds) != CALL_SIZE) ||
      (fread(most, 8, CALL_SIZE, seeds) != CALL_SIZE)) {
    return 2;
  }
  for (long i = 0; i < (long)head[0]; i++) {
    if (fread(row, 8, CALL_SIZE, seeds) != CALL_SIZE) {
      return 2;
    }
    if (tries(row) || (kept_count < 64u)) {
      kept_rows[kept_count++ % KEPT] = copied(row);
    }
  }
  while ((blocks < most_blocks) && (sites_known > 0u)) {
    comparison *site = known[below(sites_known)];
    const int side = (int)below(SIDES);
    const unsigned held = (kept_count < KEPT) ? kept_count : KEPT;
    bool aims = false;
    if (!site->found[side] && (site->row[side] != NULL)) {
      memcpy(row, site->row[side], sizeof(row));
      const unsigned way = below(4u);
      if (way < 2u) {
        (void)tries(row);
        aims = aim(row, site, side);
      } else if (way == 2u) { /* a step as long as what is missing, or shorter */
        const unsigned i = some_place();
        const double step = site->nearest[side] * pow(0.5, (double)below(12u) - 2.0);
        set(row, i, (below(2u) == 0u) ? (row[i] + step) : (row[i] - step));
        aims = true;
      }
    } else {
      memcpy(row, kept_rows[below(held)], sizeof(row));
    }
    if (!aims) {
      change(row);
    }
    if (tries(row)) {
      kept_rows[kept_count++ % KEPT] = copied(row);
      fwrite(row, 8, CALL_SIZE, found);
    }
  }
  fclose(found);
  return 0;
}
