/* Calls a kernel that is linked with it: reads the arrays from one file, writes them to another.
   A file has 64-bit numbers (bytes of arena and state, cases, intervals, arrays), then every
   array: its bytes, preceded by their number. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 128 };

void run(void **pointers, void *state, int64_t begin, int64_t end, int64_t a, int64_t b);

static void *room(int64_t size)
{
    size_t whole = (size_t)(size / ALIGNMENT + 1) * ALIGNMENT;
    void *found = aligned_alloc(ALIGNMENT, whole);
    if (!found) exit(2);
    return memset(found, 0, whole);
}

static void take(void *to, int64_t size, FILE *file)
{
    if (fread(to, 1, (size_t)size, file) != (size_t)size) exit(3);
}

int main(int count, char **names)
{
    FILE *in = count == 3 ? fopen(names[1], "rb") : NULL;
    FILE *out = in ? fopen(names[2], "wb") : NULL;
    if (!out) return 1;
    struct { int64_t arena, state, cases, intervals, arrays; } head;
    take(&head, sizeof head, in);
    int64_t *sizes = room(head.arrays * (int64_t)sizeof *sizes);
    void **pointers = room((1 + head.arrays) * (int64_t)sizeof *pointers);
    pointers[0] = room(head.arena);
    for (int64_t i = 0; i < head.arrays; i++) {
        take(&sizes[i], sizeof sizes[i], in);
        pointers[1 + i] = room(sizes[i]);
        take(pointers[1 + i], sizes[i], in);
    }
    run(pointers, room(head.state), 0, head.cases, 0, head.intervals);
    for (int64_t i = 0; i < head.arrays; i++)
        if (fwrite(pointers[1 + i], 1, (size_t)sizes[i], out) != (size_t)sizes[i]) return 4;
    return fclose(out);
}
