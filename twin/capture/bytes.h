/* Bytes of a file that somebody else has made, and the changes that are found in it: what the scanners of dumps and
   tables share. No byte is read and no change is written but by the functions here. */
#pragma once
#include "../native/core.h"

#define NO_BYTE (-1) /* in the place of a byte beyond the last one */

typedef struct {
    const uint8_t *data;
    int64_t size;
} BYTES;

typedef struct {
    int64_t *times;
    uint8_t *which;
    int64_t room, count;
} CHANGES;

INLINE int byte_at(BYTES text, int64_t i) { return i < text.size ? text.data[i] : NO_BYTE; }

INLINE int is_digit(int c) { return c >= '0' && c <= '9'; }

/* 1 if a word begins at a place. */
INLINE int begins(BYTES text, int64_t i, const char *word) {
    while (*word && byte_at(text, i) == *word)
        i++, word++;
    return !*word;
}

INLINE void add_change(CHANGES *found, int64_t time, int64_t which) {
    CHECK(found->count < found->room);
    found->times[found->count] = time;
    found->which[found->count++] = (uint8_t)which;
}
