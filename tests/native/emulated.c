/* A plant of a file advanced along its ticks, on whatever machine this is made for: `emulated FILE OUT` (emulated.py).

   FILE: for each part, MEMORY and the ticks their number of bytes and these; OUT: the parts afterwards, one by one. */
#include "../../twin/native/core.c"
#include <stdio.h>
#include <stdlib.h>

static void *block(FILE *file, int64_t *bytes) {
    if (fread(bytes, sizeof *bytes, 1, file) != 1)
        exit(2);
    void *made = malloc((size_t)*bytes + 1);
    if (made == NULL || fread(made, 1, (size_t)*bytes, file) != (size_t)*bytes)
        exit(2);
    return made;
}

int main(int count, char **words) {
    enum { PARTS = offsetof(MEMORY, joints) / sizeof(void *) };
    FILE *file = count == 3 ? fopen(words[1], "rb") : NULL;
    if (file == NULL)
        return 2;
    void *parts[PARTS];
    int64_t bytes[PARTS], size, ticks, changes, until;
    for (int i = 0; i < PARTS; i++)
        parts[i] = block(file, &bytes[i]);
    MEMORY *memory = block(file, &size);
    memcpy(memory, parts, sizeof parts);
    int64_t *t_ns = block(file, &ticks);
    int32_t *delta = block(file, &changes);
    until = *(int64_t *)block(file, &size);
    int64_t n = ticks / (int64_t)sizeof *t_ns, axes = n ? changes / (int64_t)sizeof *delta / n : 0;
    advance(memory, until, t_ns, n, delta, axes, NULL, 0, 0);
    FILE *out = fopen(words[2], "wb");
    for (int i = 0; out != NULL && i < PARTS; i++)
        fwrite(parts[i], 1, (size_t)bytes[i], out);
    return out == NULL || fclose(out) != 0;
}
