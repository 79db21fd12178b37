#include "@TABLE@.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define PARAMETERS (@COUNT@)

typedef enum { FREE, NUMBER, WHOLE, TRUTH } @KIND@;

typedef struct {
  size_t offset;
  uint32_t count;
  uint32_t size;
  @KIND@ kind;
  @REAL@ least; /* of floats */
  @REAL@ most;
  int64_t lowest; /* of whole numbers */
  int64_t highest;
} @ROW@;

static const @ROW@ rows[] = {
@ROWS@
};
static uint32_t with_byte(uint32_t sum, uint8_t byte)
{
  uint32_t next = sum ^ (uint32_t)byte;

  for (int32_t bit = 0; bit < 8; bit++) {
    next = ((next & 1u) != 0u) ? ((next >> 1) ^ 0xEDB88320u) : (next >> 1);
  }
  return next;
}

/* The bits of an element of 1, 2, 4 or 8 bytes, whichever byte the processor keeps first. */
static uint64_t bits_of(const uint8_t *place, uint32_t size)
{
  uint64_t bits = 0u;
  uint32_t word = 0u;
  uint16_t half = 0u;

  if (size == 8u) {
    (void)memcpy(&bits, place, sizeof(bits));
  } else if (size == 4u) {
    (void)memcpy(&word, place, sizeof(word));
    bits = word;
  } else if (size == 2u) {
    (void)memcpy(&half, place, sizeof(half));
    bits = half;
  } else {
    bits = *place;
  }
  return bits;
}

/* The whole number of an element, whose highest bit is its sign. */
static int64_t whole_of(const uint8_t *place, uint32_t size)
{
  const uint64_t sign = UINT64_C(1) << ((8u * size) - 1u);
  const uint64_t bits = (bits_of(place, size) ^ sign) - sign;
  int64_t x;

  (void)memcpy(&x, &bits, sizeof(x));
  return x;
}

static bool is_in_range(const @ROW@ *row, const uint8_t *place)
{
  bool is_right = true;

  if (row->kind == NUMBER) {
    @REAL@ x;
    (void)memcpy(&x, place, sizeof(x));
    is_right = (x >= row->least) && (x <= row->most); /* false for what is not a number */
  } else if (row->kind == WHOLE) {
    const int64_t x = whole_of(place, row->size);
    is_right = (x >= row->lowest) && (x <= row->highest);
  } else if (row->kind == TRUTH) {
    is_right = *place <= 1u;
  } else {
    is_right = true;
  }
  return is_right;
}

static bool are_in_range(const @ROW@ *row, const uint8_t *bytes)
{
  bool are_right = true;

  for (uint32_t i = 0u; i < row->count; i++) {
    if (!is_in_range(row, &bytes[row->offset + (i * row->size)])) {
      are_right = false;
    }
  }
  return are_right;
}

static uint32_t with_elements(uint32_t sum, const @ROW@ *row, const uint8_t *bytes)
{
  uint32_t next = sum;

  for (uint32_t i = 0u; i < row->count; i++) {
    uint64_t bits = bits_of(&bytes[row->offset + (i * row->size)], row->size);
    for (uint32_t place = 0u; place < row->size; place++) {
      next = with_byte(next, (uint8_t)(bits & 0xFFu));
      bits >>= 8;
    }
  }
  return next;
}

int32_t @CHECK@(const @TABLE@ *p)
{
  int32_t wrong = 0;

  for (int32_t number = 0; (number < PARAMETERS) && (wrong == 0); number++) {
    if (!are_in_range(&rows[number], (const uint8_t *)p)) {
      wrong = number + 1;
    }
  }
  return wrong;
}

uint32_t @CHECKSUM@(const @TABLE@ *p)
{
  uint32_t sum = 0xFFFFFFFFu;

  for (int32_t number = 0; number < PARAMETERS; number++) {
    sum = with_elements(sum, &rows[number], (const uint8_t *)p);
  }
  return sum ^ 0xFFFFFFFFu;
}
